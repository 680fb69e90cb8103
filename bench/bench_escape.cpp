// The corrected form's share of scattered light that escapes: four directions (medulla/detail/escape.hpp) against the
// integrals over all directions (sim3d/model/escape.hpp), and what a fibre costs. With --fit, the four directions that
// come nearest.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>
#include <vector>

#include "medulla/medulla.hpp"
#include "sim3d/model/escape.hpp"

using namespace medulla;

namespace {

struct Case {
    FurParameters<1> p;
    double exact;
};

sim3d::Fibre fibre_of(const FurParameters<1>& p) {
    sim3d::Fibre f;
    f.eta_c = double(p.eta), f.kappa = double(p.kappa), f.layers = double(p.layers), f.g = double(p.g);
    f.sigma_ms = double(p.sigma_ms), f.sigma_ma = double(p.sigma_ma);
    return f;
}

/// Materials as fur has them: eta 1.1 to 1.8, absorption up to 1.6 (cortex) and 0.8 (medulla) per radius.
std::vector<Case> random_cases(int count) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> u(0, 1);
    std::vector<Case> cases;
    for (int i = 0; i < count; ++i) {
        FurParameters<1> p;
        p.scattering = Scattering::corrected;
        p.kappa = float(0.1 + 0.9 * u(random)), p.eta = float(1.1 + 0.7 * u(random));
        p.layers = float(0.3 + 2 * u(random)), p.g = float(0.85 * u(random));
        p.sigma_ms = float(0.2 * std::pow(40, u(random))), p.sigma_ma = float(std::pow(10, -2.5 + 2.4 * u(random)));
        p.sigma_ca[0] = float(std::pow(10, -2 + 2.2 * u(random)));
        cases.push_back({p, sim3d::escape(fibre_of(p), double(p.sigma_ca[0]))});
    }
    return cases;
}

/// Offsets, places and weights: [escaping, returning][offset 0, 1, weight of 0, place 0, 1].
using Rule = std::array<double, 10>;
constexpr Rule shipped_rule = {0.57, 0.60, 0.17, 0.84, 0.12, 0.51, 0.89, 0.71, 0.63, 0.99};

double escape(const FurParameters<1>& p, const Rule& rule) {
    const double eta = double(p.eta), kappa = double(p.kappa), ms = double(p.sigma_ms), all = ms + double(p.sigma_ma);
    const double kept = sim3d::left_by_medulla(fibre_of(p)), least = std::sqrt(1 - 1 / (eta * eta));
    double out = 0, sum = 0;
    for (std::size_t i = 0; i < 4; ++i) {
        const double* zone = rule.data() + 5 * (i / 2);
        const double widest = i < 2 ? std::min(kappa, 1 / eta) : kappa, b = widest * zone[i % 2];
        const double cos_b = std::sqrt(1 - b * b), half = std::sqrt(kappa * kappa - b * b);
        const double critical = std::min(1.0, least / cos_b), angle = std::acos(critical);
        const double inside = 0.5 * (angle + std::sin(angle) * critical), place = zone[3 + i % 2];
        const double cos_theta = i < 2 ? 1 - (1 - critical) * place : critical * place;
        double F = 1;
        if (i < 2) {
            const double x = eta * cos_theta * cos_b;
            F = detail::cuticle(double(p.layers), eta * eta - 1, std::sqrt(x * x - eta * eta + 1), x).F;
        }
        const double chord = 2 * half / cos_theta, u = std::exp(-all * chord);
        const double cortex = std::exp(-double(p.sigma_ca[0]) * (cos_b - half) / cos_theta);
        const double share = widest * (i % 2 ? 1 - zone[2] : zone[2]) * (i < 2 ? inside : pi / 4 - inside) *
                             -std::expm1(-ms * chord) / (1 - F * cortex * cortex * u);
        out += share * (1 - F) * cortex, sum += share * (1 - F * cortex * cortex * (u + (1 - u) * kept));
    }
    return out / sum;
}

/// Squares, and more for what is far off.
double badness(const std::vector<Case>& cases, const Rule& rule) {
    double sum = 0;
    for (const Case& c : cases) {
        const double x = std::log(escape(c.p, rule) / c.exact);
        sum += x * x + std::pow(5 * x, 4);
    }
    return sum;
}

void fit(const std::vector<Case>& cases) {
    std::mt19937_64 random(3);
    std::uniform_real_distribution<double> u(-0.15, 0.15);
    Rule best = shipped_rule;
    double least = badness(cases, best);
    for (int start = 0; start < 8; ++start) {
        Rule rule = shipped_rule;
        for (double& x : rule) x = start > 0 ? std::clamp(x + u(random), 0.03, 0.97) : x;
        double here = badness(cases, rule);
        for (double step = 0.08; step > 0.003;) {
            bool better = false;
            for (double& x : rule)
                for (const double d : {step, -step}) {
                    const double before = x;
                    x = std::clamp(x + d, 0.002, 0.995);
                    const double there = badness(cases, rule);
                    if (there < here)
                        here = there, better = true;
                    else
                        x = before;
                }
            if (!better) step /= 2;
        }
        if (here < least) least = here, best = rule;
    }
    std::printf("badness %.4f, as shipped %.4f:", least, badness(cases, shipped_rule));
    for (const double x : best) std::printf(" %.3f", x);
    std::printf("\n");
}

}  // namespace

int main(int argc, char** argv) {
    int count = 1000;
    bool wanted = false;
    std::string json;
    CLI::App app("The share of scattered light that escapes: four directions against integrals");
    app.add_option("--materials", count, "random materials")->check(CLI::Range(10, 1000000));
    app.add_flag("--fit", wanted, "fit the four directions");
    app.add_option("--json", json, "write the numbers to FILE");
    CLI11_PARSE(app, argc, argv);
    const std::vector<Case> cases = random_cases(count);
    std::vector<double> errors;
    double rounding = 0;
    for (const Case& c : cases) {
        detail::ScatteredEnergy<4> s;
        const float sigma_ca[4] = {c.p.sigma_ca[0]};
        detail::set_corrected(c.p, sigma_ca, false, s);
        errors.push_back(std::abs(double(s.escape[0]) / c.exact - 1));
        rounding = std::max(rounding, std::abs(double(s.escape[0]) / escape(c.p, shipped_rule) - 1));
    }
    std::sort(errors.begin(), errors.end());
    const double median = errors[errors.size() / 2], high = errors[errors.size() * 9 / 10], worst = errors.back();

    double least[2] = {1e9, 1e9};
    float sum = 0;
    for (int k = 0; k < 2; ++k) {
        FurParameters<3> p = parameters_of<3>(*find_preset("red_fox"));
        p.scattering = k == 0 ? Scattering::published : Scattering::corrected;
        const TableRanges ranges = ranges_of(p);
        std::vector<unsigned char> memory(tables_bytes(default_pack(), ranges) + 64);
        void* at = memory.data() + (64 - reinterpret_cast<std::uintptr_t>(memory.data()) % 64) % 64;
        const DenseTables* tables = make_tables(default_pack(), ranges, at, memory.size() - 64).tables;
        for (int repeat = 0; repeat < 300; ++repeat) {
            const auto start = std::chrono::steady_clock::now();
            for (int i = 0; i < 2000; ++i) {
                p.sigma_ca[0] = 0.1f + 1e-4f * float(i);
                sum += make_fibre(p, tables).scattered.escape[0];
            }
            const std::chrono::duration<double> time = std::chrono::steady_clock::now() - start;
            least[k] = std::min(least[k], time.count() / 2000 * 1e9);
        }
    }
    std::printf("share that escapes, %d materials: error median %.4f, 90 %% %.4f, worst %.4f; rounding %.1e\n", count,
                median, high, worst, rounding);
    std::printf("make_fibre [ns]: published %.0f, corrected %.0f%s\n", least[0], least[1], sum < 0 ? " " : "");
    if (wanted) fit(cases);
    if (!json.empty())
        std::ofstream(json) << nlohmann::json{{"median", median}, {"worst", worst},        {"rounding", rounding},
                                              {"high", high},     {"published", least[0]}, {"corrected", least[1]}}
                                   .dump(1)
                            << '\n';
}
