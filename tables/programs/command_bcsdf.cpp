// furtable bcsdf and furtable presets: evaluates the fur model lobe by lobe.
#include <fmt/format.h>

#include <cstdlib>
#include <memory>

#include "medulla/medulla.hpp"
#include "tables/job/material.hpp"
#include "tables/programs/commands.hpp"
#include "tables/programs/number.hpp"
#include "tables/store/json_text.hpp"

namespace medulla::tables {
namespace {

struct BcsdfArguments {
    std::string preset, material, range, pack = "default", form, scattering;
    double theta_i = 0, theta_r = 0, phi = 0, h = 0;
    bool far = false, json = false;
    const CLI::Option* h_given = nullptr;
};

Offsets offsets_of(const BcsdfArguments& args) {
    if (args.far) return {-1, 1};
    if (*args.h_given) {
        if (!(args.h >= -1 && args.h <= 1)) throw UsageError("--h: expected a value in [-1, 1], found {:g}", args.h);
        return {static_cast<float>(args.h), static_cast<float>(args.h)};
    }
    const std::size_t colon = std::min(args.range.find(':'), args.range.size() - 1);
    const auto low = parse_number<double>(args.range.substr(0, colon)),
               high = parse_number<double>(args.range.substr(colon + 1));
    if (!low || !high || !(-1 <= *low && *low <= *high && *high <= 1))
        throw UsageError("--h-range: expected A:B with -1 <= A <= B <= 1, found '{}'", args.range);
    return {static_cast<float>(*low), static_cast<float>(*high)};
}

/// One number for grey fur, three for coloured.
nlohmann::ordered_json colour(const double (&value)[3], bool grey) {
    if (grey) return value[0];
    return {value[0], value[1], value[2]};
}

/// Warns if the fibre's parameters are outside the pack's axes, where the runtime clamps them.
void warn_beyond_axes(const FurParameters<3>& p, double theta_i, double offset, const Source& pack,
                      const std::string& path) {
    const detail::Inclination<double> at = detail::inclination(static_cast<double>(p.eta), std::cos(theta_i));
    Parameters evaluated;
    const double radius = static_cast<double>(p.kappa) * at.inverse_cos_t;
    evaluated.sigma = radius * static_cast<double>(p.sigma_ms), evaluated.g = static_cast<double>(p.g);
    evaluated.theta_i = std::abs(theta_i);
    evaluated.h =
        std::min(offset * at.inverse_index / static_cast<double>(p.kappa), 1.0);  // beyond, light misses the medulla
    if (pack.absorbs()) evaluated.absorption = radius * static_cast<double>(p.sigma_ma);
    std::string beyond;
    for (const TableKind kind : lobe_kinds) {
        const std::string one = pack.beyond(kind, evaluated);
        if (beyond.find(one) == std::string::npos) beyond += (beyond.empty() ? "" : "; ") + one;
    }
    if (!beyond.empty())
        say("furtable",
            fmt::format("warning: {}: {}: TTs and TRTs are evaluated at the end of the axis", path, beyond));
}

/// Dense tables with their memory; empty for a fibre that does not scatter.
struct OwnedTables {
    std::unique_ptr<void, decltype(&std::free)> memory{nullptr, &std::free};
    const DenseTables* view = nullptr;
};
OwnedTables tables_for(const FurParameters<3>& p, const PackView& pack, const std::string& path) {
    OwnedTables tables;
    if (!(p.kappa > 0 && p.sigma_ms > 0)) return tables;
    const TableRanges ranges = ranges_of(p);
    const std::size_t bytes = (tables_bytes(pack, ranges) + 63) / 64 * 64;
    tables.memory.reset(std::aligned_alloc(64, std::max<std::size_t>(bytes, 64)));
    const TablesResult made = make_tables(pack, ranges, tables.memory.get(), bytes);
    if (made.status != TablesStatus::ok) throw Error("{}: {}", path, describe(made.status));
    tables.view = made.tables;
    return tables;
}

void run_bcsdf(const BcsdfArguments& args) {
    const auto check = [](const char* name, double degrees, const char* range) {
        if (!(degrees >= -90 && degrees <= 90))
            throw UsageError("{}: expected degrees in {}, found {}", name, range, degrees);
    };
    check("--theta-i", args.theta_i, "(-90, 90)"), check("--theta-r", args.theta_r, "[-90, 90]");
    const double phi = std::remainder(args.phi, 360.0);
    const Offsets range = offsets_of(args);
    Material material;
    if (args.material.empty()) {
        try {
            material = preset_material(args.preset, "--preset");
        } catch (const Error& error) {
            throw UsageError("{}", error.what());
        }
    } else {
        material = read_material(args.material);
    }
    if (!args.scattering.empty())
        material.fur.scattering = args.scattering == "corrected" ? Scattering::corrected : Scattering::published;
    const std::vector<unsigned char> bytes = read_pack(args.pack);
    const PackView pack = open_pack(bytes.data(), bytes.size()).pack;
    const double radians = pi / 180, theta_i = args.theta_i * radians;
    const OwnedTables tables = tables_for(material.fur, pack, args.pack);
    const Fibre<3> fibre = make_fibre(material.fur, tables.view);
    const Angles known = {static_cast<float>(theta_i), 0};
    const float theta_r = static_cast<float>(args.theta_r * radians), azimuth = static_cast<float>(phi * radians);
    const bool one_offset = range.low == range.high;
    const NearField<3> at_one = near_field(fibre, known, range.low);
    const FarField<3> mean = far_field(fibre, known, range);
    if (!(at_one.known.cosine > 0))
        throw UsageError(
            "--theta-i: expected degrees within (-90, 90), since light along the fibre meets no section, found {}",
            args.theta_i);
    if (tables.view != nullptr)
        warn_beyond_axes(material.fur, theta_i,
                         static_cast<double>(std::max(std::abs(range.low), std::abs(range.high))),
                         *pack_source(bytes, args.pack), args.pack);
    const LobeValues<3> lobes = one_offset ? at_one.lobes(theta_r, azimuth) : mean.lobes(theta_r, azimuth);
    const int count = args.form == "published" ? lobe_count : all_lobe_count;
    const double cosine = std::cos(theta_i);
    nlohmann::ordered_json json;
    double sum[3] = {}, density_sum[3] = {};
    if (!args.json)
        print("{:<8} {:>12}  {:>12}  {:>12}\n", "lobe", "M [1/rad]", "N [1/rad]", "M N / cos^2 theta_i [1/rad^2]");
    for (int lobe = 0; lobe < count; ++lobe) {
        double N[3], density[3], value[3];
        for (int c = 0; c < 3; ++c) {
            N[c] = static_cast<double>(lobes.N[lobe][c]);
            density[c] = static_cast<double>(lobes.M[lobe]) * N[c];
            value[c] = density[c] / (cosine * cosine);
            sum[c] += value[c], density_sum[c] += density[c];
        }
        json["lobes"][lobe_names[lobe]] = {{"M", lobes.M[lobe]},
                                           {"N", colour(N, material.grey)},
                                           {"value", colour(value, material.grey)},
                                           {"density", colour(density, material.grey)}};
        for (int c = 0; c < (material.grey ? 1 : 3) && !args.json; ++c)
            print("{:<8} {:>12.6g}  {:>12.6g}  {:>12.6g}\n", c == 0 ? lobe_names[lobe] : "",
                  static_cast<double>(lobes.M[lobe]), N[c], value[c]);
    }
    json["sum"] = colour(sum, material.grey);
    json["density"] = colour(density_sum, material.grey);
    if (args.json)
        print("{}\n", json_line(json));
    else
        print("{}\n", fmt::format("sum      {:.6g}", fmt::join(sum, sum + (material.grey ? 1 : 3), "  ")));
}

struct PresetArguments {
    bool json = false;
};

/// The printed decimal number: 0.88, not the nearest float.
double as_printed(float x) { return std::stod(fmt::format("{}", x)); }

void run_presets(const PresetArguments& args) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    constexpr const char* line = "{:<19} {:>6} {:>6} {:>6} {:>7} {:>7} {:>8} {:>8} {:>8} {:>5} {:>6}\n";
    if (!args.json) {
        print(line, "name", "kappa", "eta", "alpha", "beta_m", "beta_n", "sigma_ca", "sigma_ms", "sigma_ma", "g",
              "layers");
        // Sigmas are per fibre radius.
        print(line, "", "", "", "deg", "deg", "deg", "1/r", "1/r", "1/r", "", "");
    }
    const auto add = [&](const FurPreset& p) {
        json.push_back({{"name", p.name},
                        {"kappa", as_printed(p.kappa)},
                        {"eta", as_printed(p.eta)},
                        {"alpha", as_printed(p.alpha)},
                        {"beta_m", as_printed(p.beta_m)},
                        {"beta_n", as_printed(p.beta_n)},
                        {"sigma_ca", as_printed(p.sigma_ca)},
                        {"sigma_ms", as_printed(p.sigma_ms)},
                        {"sigma_ma", as_printed(p.sigma_ma)},
                        {"g", as_printed(p.g)},
                        {"layers", as_printed(p.layers)},
                        {"fresnel", p.scattering == Scattering::corrected ? "exact" : "bravais"},
                        {"scattering", p.scattering == Scattering::corrected ? "corrected" : "published"}});
        if (!args.json)
            print(line, p.name, p.kappa, p.eta, p.alpha, p.beta_m, p.beta_n, p.sigma_ca, p.sigma_ms, p.sigma_ma, p.g,
                  p.layers);
    };
    for (const FurPreset& p : fur_presets) add(p);
    for (const FurPreset& p : corrected_presets) add(p);
    if (args.json) print("{}\n", json_line(nlohmann::ordered_json{{"presets", json}}));
}

}  // namespace

void add_bcsdf(CLI::App& app, Action& action) {
    add_command<BcsdfArguments>(
        app, action, "bcsdf", "the fur model lobe by lobe: M, N, M N / cos^2 theta_i",
        [](CLI::App& command, BcsdfArguments& args) {
            auto* which = command.add_option_group("material")->require_option(1);
            which->add_option("--preset", args.preset, "animal of Table 4 (furtable presets)");
            which->add_option("--material", args.material, "JSON file of one material");
            add_number(command, "--theta-i", args.theta_i, "inclination of the light, degrees in (-90, 90)")
                ->required();
            add_number(command, "--theta-r", args.theta_r, "inclination of exit, degrees in [-90, 90]")->required();
            add_number(command, "--phi", args.phi,
                       "azimuth of exit minus that of the light, degrees, modulo 360; 0 = back")
                ->required();
            auto* where = command.add_option_group("offset")->require_option(1);
            args.h_given = add_number(*where, "--h", args.h, "near field: one offset in [-1, 1]");
            where->add_option("--h-range", args.range, "mean over offsets A:B");
            where->add_flag("--far", args.far, "far field: mean over -1:1");
            command
                .add_option("--pack", args.pack,
                            "tables of the scattered lobes; parameters outside its axes are clamped, with a warning")
                ->capture_default_str();
            command.add_option("--form", args.form, "published: the five lobes of Eq. 12, without the residual lobe")
                ->check(CLI::IsMember({"published"}));
            command
                .add_option("--scattering", args.scattering,
                            "form of the scattered lobes, published or corrected; without: the material's")
                ->check(CLI::IsMember({"published", "corrected"}));
            command.add_flag("--json", args.json, "print one JSON object");
        },
        run_bcsdf);
}

void add_presets(CLI::App& app, Action& action) {
    add_command<PresetArguments>(
        app, action, "presets",
        "the animals of Table 4, and those fitted for the corrected form (angles in degrees, sigma per fibre radius)",
        [](CLI::App& command, PresetArguments& args) {
            command.add_flag("--json", args.json, "print one JSON object");
        },
        run_presets);
}

}  // namespace medulla::tables
