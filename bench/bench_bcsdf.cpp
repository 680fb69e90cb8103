// The BCSDF's nanoseconds beside its errors: lookups by rank, near field, far field by quality and by segments,
// sampling. Build: g++ -O2 -std=c++17 -I runtime/include -I tests bench/bench_bcsdf.cpp -o bench_bcsdf Run: bench_bcsdf
// [--pack FILE.furpack] [--json FILE]; without a pack, the analytic one of the tests.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include "analytic_pack.hpp"
#include "fur_reference.hpp"
#include "medulla/medulla.hpp"

using namespace medulla;

namespace {

volatile float sink;

/// Nanoseconds per item: the least of nine runs, since the machine's other work only ever adds.
template <class Run>
double nanoseconds(int items, Run&& run) {
    double best = 1e300;
    for (int repeat = 0; repeat < 9; ++repeat) {
        const auto start = std::chrono::steady_clock::now();
        run();
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
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

void bench_lookups(const PackView& pack, const std::string& label) {
    const TableView& view = pack[TableKind::azimuthal];
    MaterialTable material;
    prepare_table(view, 0.4f, material);
    Contraction c;
    const auto q = queries(4096);
    contract(material, 2.0f, 0.3f, c);
    const std::string rank = "rank " + std::to_string(view.layout.even_rank + view.layout.odd_rank) + label;
    report("lookup of a prepared lobe, " + rank,
           nanoseconds(int(q.size()),
                       [&] {
                           float sum = 0;
                           for (const Query& x : q) sum += lobe(material, c, x.phi);
                           sink = sum;
                       }),
           "ns");
    report("lookup with sigma and h contracted, two angles, " + rank,
           nanoseconds(int(q.size()),
                       [&] {
                           float sum = 0;
                           for (const Query& x : q) {
                               contract(material, 2 + x.theta_i, std::abs(x.h), c);
                               sum += lobe(material, c, x.phi) + lobe(material, c, x.theta_r);
                           }
                           sink = sum;
                       }),
           "ns");
}

void bench_near(const FurFibre<3>& fibre) {
    const auto q = queries(4096);
    double error = 0, norm = 0;
    for (const Query& x : q) {
        if (std::abs(x.h) > 0.999f) continue;
        const auto a = near_lobes(fibre, x.theta_i, x.theta_r, x.phi, x.h);
        const PackView pack = {{fibre.azimuthal.view, fibre.back.view, fibre.forward.view, {}}, nullptr, 0};
        const auto b = reference::near_lobes(fibre.parameters, pack, double(x.theta_i), double(x.theta_r),
                                             double(x.phi), double(x.h));
        double va = 0, vb = 0;
        for (int k = 0; k < lobe_count; ++k) va += double(a.M[k]) * double(a.N[k][0]), vb += b.M[k] * b.N[k][0];
        error += (va - vb) * (va - vb), norm += vb * vb;
    }
    report("near field, five lobes, RGB, from scratch",
           nanoseconds(int(q.size()),
                       [&] {
                           float sum = 0;
                           for (const Query& x : q) sum += eval(fibre, x.theta_i, x.theta_r, x.phi, x.h).value[0];
                           sink = sum;
                       }),
           "ns", std::sqrt(error / norm));
    NearField<3> near;
    report("near field, preparing (theta_i, h)",
           nanoseconds(int(q.size()),
                       [&] {
                           float sum = 0;
                           for (const Query& x : q) near_field(fibre, x.theta_i, x.h, near), sum += near.energy.A[0][0];
                           sink = sum;
                       }),
           "ns");
    near_field(fibre, 0.3f, 0.4f, near);
    report("near field, one exit of a prepared (theta_i, h)",
           nanoseconds(int(q.size()),
                       [&] {
                           float sum = 0;
                           for (const Query& x : q) sum += near.eval(x.theta_r, x.phi).value[0];
                           sink = sum;
                       }),
           "ns");
    report("near field, per exit in batches of 16",
           nanoseconds(int(q.size()),
                       [&] {
                           float sum = 0;
                           for (std::size_t i = 0; i < q.size(); i += 16) {
                               near_field(fibre, q[i].theta_i, q[i].h, near);
                               for (std::size_t k = i; k < i + 16; ++k)
                                   sum += near.eval(q[k].theta_r, q[k].phi).value[0];
                           }
                           sink = sum;
                       }),
           "ns");
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
    for (int animal = 0; animal < fur_preset_count; ++animal) {
        FurParameters<3> p = parameters_of<3>(fur_presets[animal]);
        FurFibre<3>& fibre = fibres[std::size_t(animal)];
        prepare(p, pack, fibre);
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
    const auto many = queries(256);
    const int items = int(many.size()) * fur_preset_count;
    for (int j = 0; j < 3; ++j) {
        const double time = nanoseconds(items, [&] {
            float sum = 0;
            FarField<3> far;
            for (const FurFibre<3>& fibre : fibres)
                for (const Query& x : many)
                    far_field(fibre, x.theta_i, OffsetRange{}, far, qualities[j]),
                        sum += far.eval(x.theta_r, x.phi).value[0];
            sink = sum;
        });
        report(std::string("far field, five lobes, RGB, from scratch, ") + names[j], time, "ns",
               std::sqrt(error[j][lobe_count] / norm[lobe_count]));
        for (int k = 0; k < lobe_count; ++k)
            report(std::string("  its error in ") + lobe_names[k], std::sqrt(error[j][k] / norm[k]), "");
    }
    report("far field, one exit of a prepared theta_i, standard",
           nanoseconds(items,
                       [&] {
                           float sum = 0;
                           FarField<3> far;
                           for (const FurFibre<3>& fibre : fibres) {
                               far_field(fibre, 0.3f, OffsetRange{}, far);
                               for (const Query& x : many) sum += far.eval(x.theta_r, x.phi).value[0];
                           }
                           sink = sum;
                       }),
           "ns");
    for (int j = 0; j < 4; ++j) {
        const double time = nanoseconds(64, [&] {
            float sum = 0;
            for (int i = 0; i < 64; ++i)
                for (int m = 0; m < midpoints[j]; ++m)
                    sum += eval(fibres[0], many[std::size_t(i)].theta_i, many[std::size_t(i)].theta_r,
                                many[std::size_t(i)].phi, float((2 * m + 1.0) / midpoints[j] - 1))
                               .value[0];
            sink = sum;
        });
        report("baseline: mean of " + std::to_string(midpoints[j]) + " near evaluations even in h", time, "ns",
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
void bench_sampling(const FurFibre<3>& fibre) {
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
    report("sampling: variance of a weight, lobes from the tables", ours / double(count), "");
    report("sampling: variance of a weight, scattered lobes evenly", paper / double(count), "");
    report("sampling: largest weight seen", double(largest), "");
    NearField<3> near;
    near_field(fibre, 0.3f, 0.4f, near);
    NearSampler<3> sampler;
    report("sampling: preparing a near sampler",
           nanoseconds(4096,
                       [&] {
                           for (int i = 0; i < 4096; ++i) sampler.prepare(near), sink = sampler.shares.total;
                       }),
           "ns");
    report("sampling: one near sample with its pdf and weight",
           nanoseconds(4096,
                       [&] {
                           for (int i = 0; i < 4096; ++i)
                               sink = sampler.sample({uniform(), uniform(), uniform(), uniform(), 0}).pdf;
                       }),
           "ns");
    report("sampling: one near pdf",
           nanoseconds(int(q.size()),
                       [&] {
                           for (const Query& x : q) sink = sampler.pdf(x.theta_r, x.phi);
                       }),
           "ns");
    FarField<3> far;
    far_field(fibre, 0.3f, OffsetRange{}, far);
    FarSampler<3> far_sampler;
    report("sampling: preparing a far sampler",
           nanoseconds(256,
                       [&] {
                           for (int i = 0; i < 256; ++i) far_sampler.prepare(far), sink = far_sampler.side_share;
                       }),
           "ns");
    report("sampling: one far sample with its pdf and weight",
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
    const analytic::AnalyticPack analytic_pack(15, 16), rank64(63, 16);
    std::vector<unsigned char> bytes = analytic_pack.bytes;
    if (!pack_file.empty()) {
        std::ifstream in(pack_file, std::ios::binary);
        bytes.assign(std::istreambuf_iterator<char>(in), {});
    }
    const OpenResult opened = open_pack(bytes.data(), bytes.size());
    if (opened.status != PackStatus::ok)
        return std::fprintf(stderr, "%s: %s\n", pack_file.c_str(), describe(opened.status)), 1;
    if (!pack_file.empty()) bench_lookups(opened.pack, " (the pack)");
    bench_lookups(analytic_pack.view, "");
    bench_lookups(rank64.view, "");
    FurFibre<3> fibre;
    prepare(parameters_of<3>(fur_presets[0]), opened.pack, fibre);
    bench_near(fibre);
    bench_far(opened.pack);
    bench_sampling(fibre);
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
