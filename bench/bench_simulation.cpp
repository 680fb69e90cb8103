// Run time against error of the three solvers, analog, random and deterministic, on twelve cells of both tables.
// Truth is a deterministic solution on a finer grid. One thread, in turn in one process.
// Usage: bench_simulation [--json FILE] [--svg FILE]
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <string>
#include <vector>

#include "sim2d/analog.hpp"
#include "sim2d/disc_deterministic.hpp"
#include "sim2d/slab_deterministic.hpp"
#include "sim2d/tracer.hpp"

using namespace medulla;
using namespace medulla::sim2d;

namespace {

constexpr std::size_t kBins = 720;

/// Processor time: the machine's other work costs less of it than of the wall's.
double now() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

struct Cell {
    bool disc;
    double sigma, g, along;  ///< h or theta_i
};

const Cell kCells[] = {{true, 0.3, 0.0, 0.3}, {true, 0.3, 0.8, 0.3}, {true, 2, 0.0, 0.6},    {true, 2, 0.8, 0.6},
                       {true, 12, 0.0, 0.3},  {true, 12, 0.9, 0.3},  {false, 0.3, 0.0, 0.5}, {false, 0.3, 0.8, 0.5},
                       {false, 2, 0.0, 1.2},  {false, 2, 0.8, 1.2},  {false, 12, 0.0, 0.5},  {false, 12, 0.9, 0.5}};

using Lobes = std::vector<std::vector<double>>;

Lobes lobes(const Profile& p) { return {p.lobe}; }
Lobes lobes(const SlabProfile& p) { return {p.back.lobe, p.forward.lobe}; }

/// Relative L2 distance, of the worse lobe.
double distance(const Lobes& a, const Lobes& b) {
    double worst = 0;
    for (std::size_t k = 0; k < a.size(); ++k) {
        double d = 0, n = 0;
        for (std::size_t i = 0; i < a[k].size(); ++i)
            d += (a[k][i] - b[k][i]) * (a[k][i] - b[k][i]), n += b[k][i] * b[k][i];
        worst = std::max(worst, std::sqrt(d / n));
    }
    return worst;
}

struct Point {
    double seconds, error;
};
enum Method { kAnalog, kRandom, kDeterministic, kMethods };
const char* const kNames[] = {"analog", "random", "deterministic"};
const char* const kColours[] = {"#888888", "#1f77b4", "#d62728"};

/// A deterministic solution on `scale` times the grid that it would choose, without a second grid.
Lobes solve(const Cell& c, double scale, double& seconds) {
    const double start = now();
    Lobes out;
    if (c.disc) {
        DiscOptions o;
        const double root = std::min(std::sqrt(c.sigma), 8.0), width = std::max(-std::log(std::max(c.g, 1e-9)), 0.02);
        o.circles = std::max(6, static_cast<int>(scale * (18 + 8 * root)));
        o.modes = std::max(15, static_cast<int>(scale * (23 + 5 * root + 2.3 * std::min(1 / width, 40.0))));
        o.gap = std::clamp(0.7 * width * (1 + c.sigma / 8), 0.03, 0.25) / scale;
        o.estimate_error = false;
        out = lobes(DiscSolver(c.g, o).solve(c.sigma, {c.along}, kBins)[0]);
    } else {
        SlabOptions o;
        const double wanted = c.g == 0 ? 64 : std::max(64.0, std::ceil(-9.5 / std::log(c.g)));
        o.directions = static_cast<std::size_t>(std::max(8.0, scale * wanted));
        o.estimate_error = false;
        out = lobes(SlabSolver(c.g, o).solve(c.sigma, {c.along}, kBins / 2)[0]);
    }
    seconds = now() - start;
    return out;
}

std::vector<Point> measure(const Cell& c, Method method, const Lobes& truth) {
    std::vector<Point> points;
    if (method == kDeterministic) {
        for (const double scale : {0.4, 0.6, 0.8, 1.0}) {
            double seconds = 0;
            const Lobes found = solve(c, scale, seconds);
            points.push_back({seconds, distance(found, truth)});
        }
        return points;
    }
    for (const std::uint64_t paths : {512, 4096, 32768, 262144}) {
        const double start = now();
        Lobes found;
        if (method == kAnalog) {
            TraceOptions o;
            o.paths = 4 * paths;
            found = c.disc ? lobes(trace_disc(c.sigma, c.g, c.along, kBins, o))
                           : lobes(trace_slab(c.sigma, c.g, c.along, kBins / 2, o));
        } else {
            TracerOptions o;
            o.paths = paths;
            found = c.disc ? lobes(trace_expected_disc(c.sigma, c.g, c.along, kBins, o).profile)
                           : lobes(trace_expected_slab(c.sigma, c.g, c.along, kBins / 2, o).profile);
        }
        points.push_back({now() - start, distance(found, truth)});
    }
    return points;
}

struct Result {
    Cell cell;
    std::vector<Point> points[kMethods];
};

std::string title(const Cell& c) {
    char text[96];
    std::snprintf(text, sizeof text, "%s, sigma %g, g %g, %s %g", c.disc ? "disc" : "slab", c.sigma, c.g,
                  c.disc ? "h" : "theta_i", c.along);
    return text;
}

std::string to_json(const std::vector<Result>& results) {
    std::string out = "[";
    char text[160];
    for (const Result& r : results) {
        out += (out.size() > 1 ? ",\n" : "\n") + std::string("{\"cell\":\"") + title(r.cell) + "\"";
        for (int m = 0; m < kMethods; ++m) {
            out += std::string(",\"") + kNames[m] + "\":[";
            for (std::size_t i = 0; i < r.points[m].size(); ++i) {
                std::snprintf(text, sizeof text, "%s{\"s\":%.4g,\"error\":%.4g}", i ? "," : "", r.points[m][i].seconds,
                              r.points[m][i].error);
                out += text;
            }
            out += "]";
        }
        out += "}";
    }
    return out + "\n]\n";
}

/// One small log-log panel per cell: seconds 10^-4 to 10^2 across, error 10^-6 to 10 upwards.
std::string to_svg(const std::vector<Result>& results) {
    const double w = 250, h = 190, left = 46, bottom = 34, top = 20, right = 8;
    const std::size_t columns = 4, rows = (results.size() + columns - 1) / columns;
    char text[400];
    std::snprintf(text, sizeof text,
                  "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%g\" height=\"%g\" font-family=\"sans-serif\" "
                  "font-size=\"10\">\n<rect width=\"100%%\" height=\"100%%\" fill=\"white\"/>\n",
                  w * double(columns), h * double(rows) + 24);
    std::string out = text;
    for (std::size_t i = 0; i < results.size(); ++i) {
        const double x0 = w * double(i % columns) + left, y0 = h * double(i / columns) + top;
        const double width = w - left - right, height = h - top - bottom;
        const auto x = [&](double s) { return x0 + width * (std::log10(s) + 4) / 6; };
        const auto y = [&](double e) { return y0 + height * (1 - std::log10(std::max(e, 1e-6))) / 7; };
        std::snprintf(text, sizeof text,
                      "<text x=\"%.1f\" y=\"%.1f\">%s</text><rect x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" "
                      "height=\"%.1f\" fill=\"none\" stroke=\"#aaa\"/>\n",
                      x0, y0 - 5, title(results[i].cell).c_str(), x0, y0, width, height);
        out += text;
        for (int d = -4; d <= 2; d += 2) {
            std::snprintf(
                text, sizeof text,
                "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"middle\">1e%d%s</text><line x1=\"%.1f\" y1=\"%.1f\" "
                "x2=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd\"/>\n",
                x(std::pow(10, d)), y0 + height + 12, d, d == 0 ? " s" : "", x(std::pow(10, d)), y0, x(std::pow(10, d)),
                y0 + height);
            out += text;
        }
        for (int d = -6; d <= 0; d += 2) {
            std::snprintf(text, sizeof text,
                          "<text x=\"%.1f\" y=\"%.1f\" text-anchor=\"end\">1e%d</text><line x1=\"%.1f\" y1=\"%.1f\" "
                          "x2=\"%.1f\" y2=\"%.1f\" stroke=\"#ddd\"/>\n",
                          x0 - 4, y(std::pow(10, d)) + 3, d, x0, y(std::pow(10, d)), x0 + width, y(std::pow(10, d)));
            out += text;
        }
        for (int m = 0; m < kMethods; ++m) {
            std::string path;
            for (const Point& p : results[i].points[m]) {
                std::snprintf(text, sizeof text, "%s%.1f,%.1f", path.empty() ? "" : " ", x(p.seconds), y(p.error));
                path += text;
            }
            out += std::string("<polyline fill=\"none\" stroke-width=\"1.6\" stroke=\"") + kColours[m] +
                   "\" points=\"" + path + "\"/>\n";
        }
    }
    for (int m = 0; m < kMethods; ++m) {
        std::snprintf(text, sizeof text, "<text x=\"%g\" y=\"%g\" fill=\"%s\" font-size=\"13\">%s</text>\n",
                      60 + 110.0 * m, h * double(rows) + 14, kColours[m], kNames[m]);
        out += text;
    }
    return out + "<text x=\"420\" y=\"" + std::to_string(int(h * double(rows)) + 14) +
           "\" font-size=\"13\">relative L2 error of a lobe (720 bins) against seconds on one thread</text>\n</svg>\n";
}

bool save(const std::string& file, const std::string& text) {
    if (file.empty()) return true;
    std::FILE* out = std::fopen(file.c_str(), "w");
    if (out == nullptr) return std::fprintf(stderr, "%s: cannot be written\n", file.c_str()), false;
    std::fwrite(text.data(), 1, text.size(), out);
    return std::fclose(out) == 0;
}

}  // namespace

int main(int argc, char** argv) {
    std::string json_file, svg_file;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--json") == 0 && i + 1 < argc)
            json_file = argv[++i];
        else if (std::strcmp(argv[i], "--svg") == 0 && i + 1 < argc)
            svg_file = argv[++i];
        else
            return std::fprintf(stderr, "usage: bench_simulation [--json FILE] [--svg FILE]\n"), 2;
    }
    std::vector<Result> results;
    for (const Cell& c : kCells) {
        double seconds = 0;
        const Lobes truth = solve(c, 1.5, seconds);
        Result r{c, {}};
        std::printf("%s\n", title(c).c_str());
        for (int m = 0; m < kMethods; ++m) {
            r.points[m] = measure(c, static_cast<Method>(m), truth);
            std::printf("  %-14s", kNames[m]);
            for (const Point& p : r.points[m]) std::printf("  %9.5f s %.2e", p.seconds, p.error);
            std::printf("\n");
            std::fflush(stdout);
        }
        results.push_back(r);
    }
    return save(json_file, to_json(results)) && save(svg_file, to_svg(results)) ? 0 : 1;
}
