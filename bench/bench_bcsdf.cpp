// The BCSDF's nanoseconds beside its errors: lookups by rank, near field, far field by quality and by segments,
// sampling. Run: bench_bcsdf [--pack FILE.furpack] [--json FILE]; without a pack, the one built into the runtime.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "medulla/medulla.hpp"
#include "tests/support/analytic_pack.hpp"
#include "tests/support/fur_reference.hpp"

using namespace medulla;

namespace {

volatile float sink;

/// Nanoseconds per item: the least of many runs within half a second, each well below a scheduler's slice, since the
/// machine's other work only ever adds.
template <class Run>
double nanoseconds(int items, Run&& run) {
    using Clock = std::chrono::steady_clock;
    double best = 1e300;
    const auto end = Clock::now() + std::chrono::milliseconds(500);
    for (int repeat = 0; repeat < 9 || (repeat < 4000 && Clock::now() < end); ++repeat) {
        const auto start = Clock::now();
        run();
        const std::chrono::duration<double> took = Clock::now() - start;
        best = std::min(best, took.count() * 1e9 / items);
    }
    return best;
}

struct Row {
    std::string name;
    double value;
    std::string unit;
    double error;  ///< relative L2, negative: exact by construction or not applicable
};
std::vector<Row> table;

void report(const std::string& name, double value, const std::string& unit, double error = -1) {
    if (error < 0)
        std::printf("%-58s %10.4g %s\n", name.c_str(), value, unit.c_str());
    else
        std::printf("%-58s %10.4g %-6s error %.2e\n", name.c_str(), value, unit.c_str(), error);
    table.push_back({name, value, unit, error});
}

struct Query {
    float theta_i, theta_r, phi, h;
};

/// Exits about the mirror direction, where every lobe is worth its time.
std::vector<Query> queries(int count) {
    std::mt19937 engine(1);
    std::uniform_real_distribution<float> u(0, 1);
    std::vector<Query> q;
    for (int i = 0; i < count; ++i) {
        const float theta_i = 2.4f * (u(engine) - 0.5f);
        q.push_back({theta_i, std::max(-1.5f, std::min(1.5f, -theta_i + 0.4f * (u(engine) - 0.5f))),
                     6.2831f * (u(engine) - 0.5f), 2 * u(engine) - 1});
    }
    return q;
}

/// C^N of a material (g = 0.4, sigma_ms kappa = 2) read from the factors and from its unfolded tables: one angle of a
/// prepared lobe, and the share of one lookup where sigma and h are contracted for TTs and TRTs, which read two angles.
void bench_lookups(const PackView& pack, const std::string& label, UnfoldedTables& tables) {
    FurParameters<3> p;
    p.kappa = 0.8f, p.sigma_ms = 2.5f, p.g = 0.4f;
    FurFibre<3> fibre;
    prepare(p, pack, fibre);
    if (!unfold(fibre, tables)) return;
    const MaterialTable& material = fibre.azimuthal;
    const auto q = queries(512);
    Contraction c;
    double error = 0, norm = 0;
    for (const Query& x : q) {
        const float sigma = 2.2f + 0.1f * x.theta_i;
        contract(material, sigma, std::abs(x.h), c);
        const double slow = double(lobe(material, c, x.phi)),
                     fast = double(
                         tables.azimuthal_density(tables.azimuthal_at(tables.sigma_at(sigma), std::abs(x.h)), x.phi));
        error += (fast - slow) * (fast - slow), norm += slow * slow;
    }
    const std::string rank = std::to_string(material.view.layout.even_rank + material.view.layout.odd_rank) + label;
    const auto time = [&](auto&& value) {
        return nanoseconds(int(q.size()), [&] {
            float sum = 0;
            for (const Query& x : q) sum += value(x);
            sink = sum;
        });
    };
    contract(material, 2.2f, 0.3f, c);
    report("lookup of a prepared lobe, factors, rank " + rank,
           time([&](const Query& x) { return lobe(material, c, x.phi); }), "ns");
    const AzimuthalPoint at = tables.azimuthal_at(tables.sigma_at(2.2f), 0.3f);
    report("lookup of a prepared lobe, unfolded, rank " + rank,
           time([&](const Query& x) { return tables.azimuthal_density(at, x.phi); }), "ns", std::sqrt(error / norm));
    report("lookup, half of contracting and two angles, factors, rank " + rank,
           0.5 * time([&](const Query& x) {
               contract(material, 2.2f + 0.1f * x.theta_i, std::abs(x.h), c);
               return lobe(material, c, x.phi) + lobe(material, c, x.theta_r);
           }),
           "ns");
    report("lookup, half of contracting and two angles, unfolded, rank " + rank,
           0.5 * time([&](const Query& x) {
               const TwoDensities N =
                   azimuthal_densities(tables, 2.2f + 0.1f * x.theta_i, std::abs(x.h), x.phi, x.theta_r);
               return N.TTs + N.TRTs;
           }),
           "ns", std::sqrt(error / norm));
}

/// All axes of a table at once, without and with what a lobe's dips below 0 hold.
void bench_contract(const PackView& pack) {
    const auto q = queries(512);
    const auto time = [&](const TableView& view, Contraction (*f)(const TableView&, const LobeQuery&) noexcept) {
        return nanoseconds(int(q.size()), [&] {
            float sum = 0;
            for (const Query& x : q)
                sum += f(view, {2.2f + 0.1f * x.theta_i, 0.4f, std::abs(x.h), std::abs(x.theta_i), 0}).inverse_integral;
            sink = sum;
        });
    };
    for (const auto& [kind, name] :
         {std::pair(TableKind::azimuthal, "C^N"), std::pair(TableKind::longitudinal_back, "C^M back"),
          std::pair(TableKind::longitudinal_forward, "C^M forward")}) {
        report(std::string("contract_signed, ") + name, time(pack[kind], contract_signed), "ns");
        report(std::string("contract, ") + name, time(pack[kind], contract), "ns");
    }
}

/// All five lobes in RGB; errors against the double-precision twin, which reads the factors.
void bench_near(const FurFibre<3>& fibre, const std::string& how) {
    const auto q = queries(512);
    double error = 0, norm = 0;
    std::vector<double> exact;
    for (const Query& x : q) {
        const auto a = near_lobes(fibre, x.theta_i, x.theta_r, x.phi, x.h);
        const PackView pack = {{fibre.azimuthal.view, fibre.back.view, fibre.forward.view, {}}, nullptr, 0};
        const auto b = reference::near_lobes(fibre.parameters, pack, double(x.theta_i), double(x.theta_r),
                                             double(x.phi), double(x.h));
        double va = 0, vb = 0;
        for (int k = 0; k < lobe_count; ++k) va += double(a.M[k]) * double(a.N[k][0]), vb += b.M[k] * b.N[k][0];
        error += (va - vb) * (va - vb), norm += vb * vb;
        exact.push_back(vb);
    }
    const double relative = std::sqrt(error / norm);
    const auto time = [&](auto&& value) {
        return nanoseconds(int(q.size()), [&] {
            float sum = 0;
            for (const Query& x : q) sum += value(x);
            sink = sum;
        });
    };
    report("near field, from scratch, " + how,
           time([&](const Query& x) { return eval(fibre, x.theta_i, x.theta_r, x.phi, x.h).value[0]; }), "ns",
           relative);
    NearField<3> near;
    report("near field, preparing (theta_i, h), " + how, time([&](const Query& x) {
               near_field(fibre, x.theta_i, x.h, near);
               return near.energy.A[0][0];
           }),
           "ns");
    near_field(fibre, 0.3f, 0.4f, near);
    report("near field, one exit of a prepared (theta_i, h), " + how,
           time([&](const Query& x) { return near.eval(x.theta_r, x.phi).value[0]; }), "ns", relative);
    std::vector<float> theta_r, phi;
    for (const Query& x : q) theta_r.push_back(x.theta_r), phi.push_back(x.phi);
    std::vector<Colour<3>> S(q.size());
    for (int batch : {16, 256})
        report("near field, per exit, batches of " + std::to_string(batch) + " and their preparing, " + how,
               nanoseconds(int(q.size()),
                           [&] {
                               for (std::size_t i = 0; i < q.size(); i += std::size_t(batch)) {
                                   near_field(fibre, q[i].theta_i, q[i].h, near);
                                   eval(near, batch, &theta_r[i], &phi[i], &S[i]);
                               }
                               sink = S[3].value[0];
                           }),
               "ns", relative);
    std::vector<float> theta_i, h;
    for (const Query& x : q) theta_i.push_back(x.theta_i), h.push_back(x.h);
    eval(fibre, int(q.size()), theta_i.data(), h.data(), theta_r.data(), phi.data(), S.data());
    double batch_error = 0;
    for (std::size_t i = 0; i < q.size(); ++i) {
        const double cos_i = std::cos(double(q[i].theta_i));
        batch_error += std::pow(double(S[i].value[0]) * cos_i * cos_i - exact[i], 2);
    }
    report("near field, per query, batches of unlike (theta_i, h), " + how,
           nanoseconds(int(q.size()),
                       [&] {
                           eval(fibre, int(q.size()), theta_i.data(), h.data(), theta_r.data(), phi.data(), S.data());
                           sink = S[3].value[0];
                       }),
           "ns", std::sqrt(batch_error / norm));
}

/// What unfolding changes in C^M and in N of TTs and TRTs: the worst of the animals, relative L2 against the factors.
void bench_unfolding(const PackView& pack, UnfoldedTables& tables) {
    std::mt19937 engine(2);
    std::uniform_real_distribution<float> u(0, 1);
    double worst[2] = {};
    for (const FurPreset& preset : fur_presets) {
        FurFibre<3> slow;
        prepare(parameters_of<3>(preset), pack, slow);
        FurFibre<3> fast = slow;
        if (!unfold(fast, tables)) continue;
        double error[2] = {}, norm[2] = {};
        for (int i = 0; i < 4000; ++i) {
            const float theta_i = 3.1415f * (u(engine) - 0.5f), phi = 6.2831f * u(engine), h = 2 * u(engine) - 1;
            const float theta_r = std::max(-1.5707f, std::min(1.5707f, 1.2f * (u(engine) - 0.5f) - theta_i));
            const auto a = near_lobes(fast, theta_i, theta_r, phi, h), b = near_lobes(slow, theta_i, theta_r, phi, h);
            error[0] += std::pow(double(a.M[3] - b.M[3]), 2), norm[0] += std::pow(double(b.M[3]), 2);
            for (int k = 3; k < 5; ++k)
                error[1] += std::pow(double(a.N[k][0] - b.N[k][0]), 2), norm[1] += std::pow(double(b.N[k][0]), 2);
        }
        for (int k = 0; k < 2; ++k) worst[k] = std::max(worst[k], std::sqrt(error[k] / norm[k]));
    }
    report("unfolding, error in C^M, worst animal", worst[0], "");
    report("unfolding, error in N of TTs and TRTs, worst animal", worst[1], "");
}

/// Mean of the double-precision near field over [-1, 1], as tests/test_bcsdf_far.cpp has it.
reference::Lobes mean_of_near(const FurParameters<3>& p, const PackView& pack, double theta_i, double phi, int n) {
    reference::Lobes mean;
    const double eta = double(p.eta), s = std::sin(theta_i);
    const double rim = std::asin(std::min(1.0, double(p.kappa) * std::sqrt(eta * eta - s * s) / std::cos(theta_i)));
    const double cut[4] = {-pi / 2, -rim, rim, pi / 2};
    for (int piece = 0; piece < 3; ++piece) {
        const double a = cut[piece], b = cut[piece + 1];
        for (int i = 0; b > a && i < n; ++i) {
            const double t = pi * (i + 0.5) / n, gamma = a + (b - a) * (1 - std::cos(t)) / 2;
            const auto l = reference::near_lobes(p, pack, theta_i, 0.0, phi, std::sin(gamma));
            const double w = std::cos(gamma) * (b - a) / 2 * std::sin(t) * pi / n / 2;
            for (int k = 0; k < lobe_count; ++k)
                for (int c = 0; c < 3; ++c) mean.N[k][c] += w * l.N[k][c];
        }
    }
    return mean;
}

/// Far field of R, TT, TRT in the paper's segments h_i = sqrt(i / n): Fresnel terms, half-lengths and angles linear in
/// between (Sec. 5.1), integrated densely: what its closed forms would give if they lost no digits.
void paper_segments(const FurParameters<3>& p, double theta_i, double phi, int n, double (&N)[3]) {
    const double eta = double(p.eta), kappa = double(p.kappa), s = std::sin(theta_i);
    const double index = std::sqrt(eta * eta - s * s) / std::cos(theta_i), cos_t = std::cos(std::asin(s / eta));
    struct Node {
        double transmitted, reflected, s_c, s_m, gamma_i, gamma_t;
    };
    const auto node = [&](double h) {
        const double F = reference::cuticle_reflectance(index, std::asin(h), double(p.layers)), inside = h / index;
        const double s_m = std::sqrt(std::max(0.0, kappa * kappa - inside * inside));
        return Node{(1 - F) * (1 - F), F, std::cos(std::asin(inside)) - s_m, s_m, std::asin(h), std::asin(inside)};
    };
    N[0] = N[1] = N[2] = 0;
    for (int i = 0; i < n; ++i) {
        const double h1 = std::sqrt(double(i) / n), h2 = std::sqrt((i + 1.0) / n);
        const Node a = node(h1), b = node(h2);
        const int steps = 400;
        for (int j = 0; j < steps; ++j) {
            const double t = (j + 0.5) / steps;
            const auto mix = [&](double x, double y) { return x + t * (y - x); };
            const double T = mix(a.transmitted, b.transmitted), F = mix(a.reflected, b.reflected);
            const double path =
                mix(a.s_c, b.s_c) * double(p.sigma_ca[0]) + mix(a.s_m, b.s_m) * double(p.sigma_ma + p.sigma_ms);
            const double gi = mix(a.gamma_i, b.gamma_i), gt = mix(a.gamma_t, b.gamma_t);
            for (int k = 0; k < 3; ++k) {
                const double A = k == 0 ? F : T * (k == 2 ? F : 1) * std::exp(-2 * k * path / cos_t),
                             turn = 2 * k * gt - 2 * gi;
                const double width = std::sqrt(k + 1.0) * double(p.beta_n), w = 0.5 * A * (h2 - h1) / steps;
                N[k] += w * (reference::wrapped(phi - turn - k * pi, width) +
                             reference::wrapped(phi + turn - k * pi, width));
            }
        }
    }
}

void bench_far(const PackView& pack) {
    const int directions = 24;
    const auto q = queries(directions);
    const FarQuality qualities[3] = {FarQuality::draft, FarQuality::standard, FarQuality::fine};
    const char* names[3] = {"draft", "standard", "fine"};
    double error[3][lobe_count + 1] = {}, norm[lobe_count + 1] = {};
    const int segments[4] = {5, 8, 16, 64}, midpoints[4] = {8, 32, 128, 512};
    double segment_error[4][3] = {}, midpoint_error[4] = {};
    std::vector<FurFibre<3>> fibres(fur_preset_count);
    std::vector<UnfoldedTables> tables(fur_preset_count);
    for (int animal = 0; animal < fur_preset_count; ++animal) {
        FurParameters<3> p = parameters_of<3>(fur_presets[animal]);
        FurFibre<3>& fibre = fibres[std::size_t(animal)];
        prepare(p, pack, fibre);
        unfold(fibre, tables[std::size_t(animal)]);
        for (const Query& x : q) {
            const auto r = mean_of_near(p, pack, double(x.theta_i), double(x.phi), int(60 + 8 / double(p.beta_n)));
            double whole = 0;
            for (int k = 0; k < lobe_count; ++k) norm[k] += r.N[k][0] * r.N[k][0], whole += r.N[k][0];
            norm[lobe_count] += whole * whole;
            for (int j = 0; j < 3; ++j) {
                FarField<3> far;
                far_field(fibre, x.theta_i, OffsetRange{}, far, qualities[j]);
                const auto l = far.lobes(x.theta_r, x.phi);
                double sum = 0;
                for (int k = 0; k < lobe_count; ++k)
                    error[j][k] += std::pow(double(l.N[k][0]) - r.N[k][0], 2), sum += double(l.N[k][0]);
                error[j][lobe_count] += (sum - whole) * (sum - whole);
            }
            for (int j = 0; j < 4; ++j) {
                double N[3];
                paper_segments(p, double(x.theta_i), double(x.phi), segments[j], N);
                for (int k = 0; k < 3; ++k) segment_error[j][k] += std::pow(N[k] - r.N[k][0], 2);
                double sum = 0;
                for (int i = 0; i < midpoints[j]; ++i) {
                    const auto l =
                        near_lobes(fibre, x.theta_i, x.theta_r, x.phi, float((2 * i + 1.0) / midpoints[j] - 1));
                    for (int k = 0; k < lobe_count; ++k) sum += double(l.N[k][0]) / midpoints[j];
                }
                midpoint_error[j] += (sum - whole) * (sum - whole);
            }
        }
    }
    const auto many = queries(64);
    FarField<3> far;
    /// Mean over animals of the least time over directions: animals one by one, so that runs stay short.
    const auto time = [&](const std::vector<FurFibre<3>>& animals, auto&& value) {
        double sum = 0;
        for (const FurFibre<3>& fibre : animals)
            sum += nanoseconds(int(many.size()), [&] {
                float total = 0;
                for (const Query& x : many) total += value(fibre, x);
                sink = total;
            });
        return sum / fur_preset_count;
    };
    for (int j = 0; j < 3; ++j) {
        report(std::string("far field, from scratch, mean of ten animals, ") + names[j],
               time(fibres,
                    [&](const FurFibre<3>& fibre, const Query& x) {
                        far_field(fibre, x.theta_i, OffsetRange{}, far, qualities[j]);
                        return far.eval(x.theta_r, x.phi).value[0];
                    }),
               "ns", std::sqrt(error[j][lobe_count] / norm[lobe_count]));
        for (int k = 0; k < lobe_count; ++k)
            report(std::string("  its error in ") + lobe_names[k], std::sqrt(error[j][k] / norm[k]), "");
    }
    for (const FurFibre<3>& fibre : fibres)
        report(std::string("  standard, ") + fur_presets[&fibre - &fibres[0]].name,
               nanoseconds(int(many.size()),
                           [&] {
                               float sum = 0;
                               for (const Query& x : many)
                                   far_field(fibre, x.theta_i, OffsetRange{}, far),
                                       sum += far.eval(x.theta_r, x.phi).value[0];
                               sink = sum;
                           }),
               "ns");
    report("far field, preparing theta_i, standard",
           time(fibres,
                [&](const FurFibre<3>& fibre, const Query& x) {
                    far_field(fibre, x.theta_i, OffsetRange{}, far);
                    return far.inverse_width;
                }),
           "ns");
    std::vector<FurFibre<3>> factors = fibres;
    for (FurFibre<3>& fibre : factors) fibre.tables = nullptr;
    report("far field, from scratch, factors, standard",
           time(factors,
                [&](const FurFibre<3>& fibre, const Query& x) {
                    far_field(fibre, x.theta_i, OffsetRange{}, far);
                    return far.eval(x.theta_r, x.phi).value[0];
                }),
           "ns");
    for (int j = 0; j < 4; ++j) {
        const double cost = nanoseconds(16, [&] {
            float sum = 0;
            for (int i = 0; i < 16; ++i)
                for (int m = 0; m < midpoints[j]; ++m)
                    sum += eval(fibres[0], many[std::size_t(i)].theta_i, many[std::size_t(i)].theta_r,
                                many[std::size_t(i)].phi, float((2 * m + 1.0) / midpoints[j] - 1))
                               .value[0];
            sink = sum;
        });
        report("baseline: mean of " + std::to_string(midpoints[j]) + " near evaluations even in h", cost, "ns",
               std::sqrt(midpoint_error[j] / norm[lobe_count]));
    }
    for (int j = 0; j < 4; ++j)
        for (int k = 0; k < 3; ++k)
            report(
                "baseline: the paper's " + std::to_string(segments[j]) + " linear segments, error in " + lobe_names[k],
                std::sqrt(segment_error[j][k] / norm[k]), "");
}

/// Variance of the weight's first channel, by lobes drawn as we do and with scattered ones drawn evenly in phi and as
/// cosine in theta (Sec. 6 of the paper).
void bench_sampling(const FurFibre<3>& fibre, const std::string& how) {
    std::mt19937_64 engine(3);
    const auto uniform = [&] { return float(engine() >> 40) * 0x1p-24f; };
    const auto q = queries(256);
    double ours = 0, paper = 0;
    long count = 0;
    float largest = 0;
    for (const Query& x : q) {
        NearField<3> near;
        near_field(fibre, x.theta_i, x.h, near);
        NearSampler<3> sampler;
        sampler.prepare(near);
        double s1 = 0, s2 = 0, t1 = 0, t2 = 0;
        const int samples = 400;
        for (int i = 0; i < samples; ++i) {
            const auto s = sampler.sample({uniform(), uniform(), uniform(), uniform(), 0});
            s1 += double(s.weight[0]), s2 += double(s.weight[0]) * double(s.weight[0]);
            largest = std::max(largest, s.weight[0]);
            // The paper: value of the selected lobe over its own density and its probability.
            float u = uniform();
            const int k = detail::pick_lobe(sampler.shares, u);
            double w;
            if (k < 3) {
                w = double(near.energy.A[k][0]) / double(sampler.shares.share[k]);
            } else {
                const float phi = 6.2831853f * (uniform() - 0.5f),
                            theta = std::asin(std::min(1.0f, std::max(-1.0f, 2 * uniform() - 1)));
                const auto l = near.lobes(theta, phi);
                w = double(l.M[k]) * double(l.N[k][0]) / (double(std::cos(theta)) / 2 / (2 * pi)) /
                    double(sampler.shares.share[k]);
            }
            t1 += w, t2 += w * w;
        }
        ours += s2 / samples - std::pow(s1 / samples, 2), paper += t2 / samples - std::pow(t1 / samples, 2), ++count;
    }
    report("sampling: variance of a weight, lobes from the tables, " + how, ours / double(count), "");
    report("sampling: variance of a weight, scattered lobes evenly, " + how, paper / double(count), "");
    report("sampling: largest weight seen, " + how, double(largest), "");
    NearField<3> near;
    near_field(fibre, 0.3f, 0.4f, near);
    NearSampler<3> sampler;
    report("sampling: preparing a near sampler, " + how,
           nanoseconds(4096,
                       [&] {
                           for (int i = 0; i < 4096; ++i) sampler.prepare(near), sink = sampler.shares.total;
                       }),
           "ns");
    report("sampling: one near sample with its pdf and weight, " + how,
           nanoseconds(4096,
                       [&] {
                           for (int i = 0; i < 4096; ++i)
                               sink = sampler.sample({uniform(), uniform(), uniform(), uniform(), 0}).pdf;
                       }),
           "ns");
    report("sampling: one near pdf, " + how,
           nanoseconds(int(q.size()),
                       [&] {
                           for (const Query& x : q) sink = sampler.pdf(x.theta_r, x.phi);
                       }),
           "ns");
    FarField<3> far;
    far_field(fibre, 0.3f, OffsetRange{}, far);
    FarSampler<3> far_sampler;
    report("sampling: preparing a far sampler, " + how,
           nanoseconds(256,
                       [&] {
                           for (int i = 0; i < 256; ++i) far_sampler.prepare(far), sink = far_sampler.side_share;
                       }),
           "ns");
    report("sampling: one far sample with its pdf and weight, " + how,
           nanoseconds(1024,
                       [&] {
                           for (int i = 0; i < 1024; ++i)
                               sink = far_sampler.sample({uniform(), uniform(), uniform(), uniform(), uniform()}).pdf;
                       }),
           "ns");
}

std::string escaped(const std::string& s) {
    std::string out;
    for (char c : s) out += c == '"' || c == '\\' ? std::string("\\") + c : std::string(1, c);
    return out;
}

}  // namespace

int main(int argc, char** argv) {
    std::string pack_file, json_file;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--pack") == 0 && i + 1 < argc)
            pack_file = argv[++i];
        else if (std::strcmp(argv[i], "--json") == 0 && i + 1 < argc)
            json_file = argv[++i];
        else
            return std::fprintf(stderr, "usage: bench_bcsdf [--pack FILE.furpack] [--json FILE]\n"), 2;
    }
    std::vector<unsigned char> bytes;
    if (!pack_file.empty()) {
        std::ifstream in(pack_file, std::ios::binary);
        bytes.assign(std::istreambuf_iterator<char>(in), {});
    }
    const OpenResult opened =
        pack_file.empty() ? open_pack(default_pack_words, default_pack_size) : open_pack(bytes.data(), bytes.size());
    if (opened.status != PackStatus::ok)
        return std::fprintf(stderr, "%s: %s\n", pack_file.c_str(), describe(opened.status)), 1;
    const analytic::AnalyticPack rank16(15, 16), rank64(63, 16);
    std::vector<UnfoldedTables> tables(1);
    bench_lookups(rank16.view, "", tables[0]);
    bench_lookups(rank64.view, "", tables[0]);
    bench_lookups(opened.pack, pack_file.empty() ? " (the default pack)" : " (the pack)", tables[0]);
    FurFibre<3> fibre;
    prepare(parameters_of<3>(fur_presets[0]), opened.pack, fibre);
    bench_contract(opened.pack);
    bench_near(fibre, "factors");
    fibre.exact_energy = false;
    bench_near(fibre, "factors, dips not counted");
    fibre.exact_energy = true;
    bench_sampling(fibre, "factors");
    report("unfolding a material", nanoseconds(1, [&] { sink = unfold(fibre, tables[0]) ? 1.0f : 0.0f; }) / 1000, "us");
    bench_near(fibre, "unfolded");
    bench_unfolding(opened.pack, *std::make_unique<UnfoldedTables>());
    bench_far(opened.pack);
    bench_sampling(fibre, "unfolded");
    if (json_file.empty()) return 0;
    std::FILE* out = std::fopen(json_file.c_str(), "w");
    if (out == nullptr) return std::fprintf(stderr, "%s: cannot be written\n", json_file.c_str()), 1;
    std::fprintf(out, "{\"bench\": \"bcsdf\", \"rows\": [\n");
    for (std::size_t i = 0; i < table.size(); ++i) {
        std::fprintf(out, "  {\"name\": \"%s\", \"value\": %.9g, \"unit\": \"%s\"", escaped(table[i].name).c_str(),
                     table[i].value, table[i].unit.c_str());
        if (table[i].error >= 0) std::fprintf(out, ", \"error\": %.9g", table[i].error);
        std::fprintf(out, "}%s\n", i + 1 < table.size() ? "," : "");
    }
    std::fprintf(out, "]}\n");
    return std::fclose(out) == 0 ? 0 : 1;
}
