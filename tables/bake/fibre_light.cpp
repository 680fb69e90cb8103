#include "tables/bake/fibre_light.hpp"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "medulla/baked.hpp"
#include "medulla/detail/cross_section.hpp"
#include "sim2d/random.hpp"
#include "sim3d/fibre_tracer.hpp"
#include "sim3d/model/five_lobes.hpp"
#include "tables/error.hpp"

namespace medulla::tables {
namespace {

/// Nodes of sigma_ca; with the middle of their coordinate (BakedHeader::sigma_middle) those of the least greatest error
/// of the scattered energy that interpolation between them leaves: 0.6 % over ten animals, four (theta_i, h) each, and
/// sigma_ca up to 6 (0.15 % RMS).
constexpr double nodes_of_absorption[absorption_nodes] = {0, 0.0257, 0.398, 2.2286, 4.799};
/// Absorptions of the checks: between the nodes.
constexpr double checked_absorption[] = {0.05, 0.35, 1.2};

/// eta kappa cos theta_t / cos theta_i: offset of the medulla's rim, where it is below 1.
double rim_of(const FurParameters<3>& p, double theta_i) {
    const auto at = detail::inclination(static_cast<double>(p.eta), std::cos(theta_i), Fresnel::exact);
    return static_cast<double>(p.kappa) / at.inverse_index;
}

/// With a target error.
constexpr std::uint64_t most_paths_of_a_cell = 50000000;
constexpr double edge = 0.9995;  // the last offset: at 1 nothing enters

double offset_of_node(const FibreRequest& r, double theta_i, std::size_t j) {
    const double rim = std::min(1.0, rim_of(r.material.fur, theta_i));
    if (j < r.offsets_inside)
        return std::min(edge,
                        rim * std::sin(static_cast<double>(j) / static_cast<double>(r.offsets_inside - 1) * pi / 2));
    const double v = static_cast<double>(j + 1 - r.offsets_inside) / static_cast<double>(r.offsets_beyond);
    return std::min(edge, rim + (1 - rim) * v * v);
}

}  // namespace

void check_fibre_request(const FibreRequest& r, const std::string& where) {
    const FurParameters<3>& p = r.material.fur;
    if (!(p.kappa > 0)) throw Error("{}: /kappa: expected a medulla, above 0, found {:g}", where, p.kappa);
    if (!(p.sigma_ms > 0)) throw Error("{}: /sigma_ms: expected a medulla that scatters, above 0, found 0", where);
    for (const float sigma : p.sigma_ca)
        if (!(sigma <= 6))
            throw Error("{}: /sigma_ca: expected values of at most 6 in a bake, found {:g}", where, sigma);
    // As material files have them.
    const auto within = [&](const char* field, float radians, double low, double high) {
        const double found = static_cast<double>(radians) * 180 / pi;
        if (!(found >= low && found <= high))
            throw Error("{}: /{}: expected degrees in [{:g}, {:g}] in a bake, found {:g}", where, field, low, high,
                        found);
    };
    within("alpha", p.alpha, -45, 45), within("beta_m", p.beta_m, 0, 114.5), within("beta_n", p.beta_n, 0, 114.5);
    try {
        sim3d::FibreOptions options;
        options.theta_bins = r.rows, options.phi_bins = r.columns;
        sim3d::validate(sim3d::fibre_of(p, 3), sim3d::Light{}, options);
    } catch (const std::invalid_argument& error) {
        throw Error("{}: /{}", where, error.what());
    }
}

FibreLight plan_of(const FibreRequest& request) {
    FibreLight light;
    light.request = request;
    FibreRequest& r = light.request;
    if (!(rim_of(r.material.fur, 0) < 1)) r.offsets_beyond = 0;  // eta' is least at 0
    light.program = "medulla " MEDULLA_VERSION " (" MEDULLA_COMPILER ")";
    light.sigma_ca.assign(std::begin(nodes_of_absorption), std::end(nodes_of_absorption));
    light.check_sigma_ca.assign(std::begin(checked_absorption), std::end(checked_absorption));
    for (std::size_t i = 0; i < r.inclinations; ++i)
        for (std::size_t j = 0; j < r.offsets_inside + r.offsets_beyond; ++j) {
            LightCell cell;
            cell.theta_i =
                greatest_inclination * (2 * static_cast<double>(i) / static_cast<double>(r.inclinations - 1) - 1);
            cell.h = offset_of_node(r, cell.theta_i, j);
            light.cells.push_back(cell);
        }
    for (std::size_t i = 0; i < r.checks; ++i) {
        sim2d::RandomStream random(r.seed, i, 0xC4EC);
        LightCell cell;
        cell.theta_i = greatest_inclination * (2 * random.uniform() - 1);
        cell.h = 2 * random.uniform() - 1;
        light.checks.push_back(cell);
    }
    return light;
}

LightCell simulate_cell(const FibreLight& plan, std::size_t i) {
    const bool check = i >= plan.cells.size();
    const FibreRequest& r = plan.request;
    LightCell cell = check ? plan.checks[i - plan.cells.size()] : plan.cells[i];
    sim3d::Fibre fibre = sim3d::fibre_of(r.material.fur, 1);
    fibre.sigma_ca = check ? plan.check_sigma_ca : plan.sigma_ca;
    sim3d::Light light;
    light.theta_i = cell.theta_i, light.h_low = light.h_high = cell.h;
    sim3d::FibreOptions options;
    options.paths = check ? r.check_paths : r.paths;
    if (r.target_error > 0 && !check) options.target_error = r.target_error, options.paths = most_paths_of_a_cell;
    options.seed = r.seed, options.cell = i + (check ? std::uint64_t{1} << 32 : 0);
    options.batches = check ? 8 : 4;
    options.theta_bins = r.rows, options.phi_bins = r.columns;
    const sim3d::FibreProfile profile = sim3d::trace_fibre(fibre, light, options);
    cell.density.clear(), cell.error.clear();
    cell.R = profile.white_energy(sim3d::only(sim3d::Class::R)).value;
    cell.entered = profile.white_energy(sim3d::unscattered & ~sim3d::only(sim3d::Class::R)).value;
    cell.scattered = profile.white_energy(sim3d::scattered).value;
    for (std::size_t c = 0; c < fibre.sigma_ca.size(); ++c) {
        const sim3d::DirectionalDensity density = profile.density(sim3d::scattered, c);
        cell.density.insert(cell.density.end(), density.value.begin(), density.value.end());
        cell.error.insert(cell.error.end(), density.error.begin(), density.error.end());
    }
    return cell;
}

double median_noise(const FibreLight& light) {
    std::vector<double> each;
    for (const LightCell& cell : light.cells) {
        double errors = 0, values = 0;
        for (std::size_t b = 0; b < light.bins(); ++b) {
            const double e = static_cast<double>(cell.error[b]), v = static_cast<double>(cell.density[b]);
            errors += e * e, values += v * v;
        }
        if (values > 0) each.push_back(std::sqrt(errors / values));
    }
    if (each.empty()) return 0;
    std::sort(each.begin(), each.end());
    return each[each.size() / 2];
}

double light_bytes(const FibreRequest& r) {
    const double bins = static_cast<double>(r.rows * r.columns);
    const double cells = static_cast<double>(r.inclinations * (r.offsets_inside + r.offsets_beyond));
    return 8 * bins * (cells * absorption_nodes + static_cast<double>(r.checks) * 3);
}

}  // namespace medulla::tables
