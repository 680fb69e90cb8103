// Error against samples and against processor time of the three fields of fur-render (near, far, multi-scale), on one
// coat from close up to far away. Run: bench_fields [--pixels N] [--reference N] [--threads N] [--json FILE] [--figure
// FILE]
// [--pictures FOLDER] [--from JSON]. The reference is the near field with many samples; its own variance is subtracted.
#include <sys/resource.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "error_figure.hpp"
#include "render/image_file.hpp"
#include "render/render.hpp"
#include "render/scene.hpp"

using namespace medulla;
using namespace medulla::render;

namespace {

/// Width of a pixel at the coat [diameters of a guard hair].
constexpr double pixel_widths[] = {0.125, 1, 8};
constexpr std::uint32_t sample_counts[] = {8, 32, 128};
constexpr int seeds = 3;  ///< pictures whose squared errors are averaged

struct FieldName {
    FieldChoice field;
    const char *name, *colour;
};
constexpr FieldName fields[] = {{FieldChoice::one_offset, "near", plot::blue},
                                {FieldChoice::whole_width, "far", plot::vermilion},
                                {FieldChoice::multiscale, "multiscale", plot::green}};

double processor_seconds() {
    rusage use{};
    getrusage(RUSAGE_SELF, &use);
    return double(use.ru_utime.tv_sec) + 1e-6 * double(use.ru_utime.tv_usec);
}

/// The ball of render/scenes through a lens so long that a pixel has this width at the front of its coat.
Scene scene_at(double pixel_width, int pixels) {
    Scene scene = read_scene(MEDULLA_SOURCE "/render/scenes/ball.json");
    const double diameter = 2 * double(scene.objects[0].coat[0].radius),
                 surface = double(scene.objects[0].shape.radius);
    const double distance = double(length(scene.camera.from)) - surface;
    scene.camera.to = {};
    scene.camera.fov = float(2 * std::atan(0.5 * pixels * pixel_width * diameter / distance));
    scene.picture.width = scene.picture.height = pixels;
    return scene;
}

struct Rendered {
    Film film;
    double seconds;  ///< of processor time
};

Rendered rendered(const Scene& scene, const PathTracer& tracer, std::uint32_t samples, std::uint32_t seed,
                  int threads) {
    Rendered r{Film(scene.picture.width, scene.picture.height), 0};
    RenderOptions options;
    options.samples = samples, options.seed = seed, options.threads = threads;
    const double before = processor_seconds();
    render::render(tracer, options, r.film, [](double) {});
    r.seconds = processor_seconds() - before;
    return r;
}

/// Mean over the pixels of the squared difference of luminance, less the reference's own variance.
double squared_error(const Film& film, const Film& reference) {
    double sum = 0;
    for (std::size_t i = 0; i < film.pixels.size(); ++i) {
        const double d = double(luminance(film.colour(i))) - double(luminance(reference.colour(i)));
        const double own = reference.standard_error(i);
        sum += d * d - own * own;
    }
    return sum / double(film.pixels.size());
}

/// Error against samples and seconds: a panel per distance, a curve per field.
plot::Figure figure_of(const nlohmann::ordered_json& numbers) {
    plot::Figure figure;
    figure.title = "Near, far and multi-scale fields from close up to far away";
    for (const FieldName& field : fields) {
        plot::Curve curve;
        curve.label = field.name, curve.colour = field.colour, curve.marks = true, curve.width = 2;
        figure.legend.push_back(curve);
    }
    const std::pair<const char*, const char*> costs[] = {{"samples per pixel", "samples"},
                                                         {"processor seconds", "processor_seconds"}};
    for (const auto& [cost, key] : costs) {
        std::vector<plot::Panel> panels;
        for (const auto& distance : numbers.at("distances")) {
            plot::Panel panel;
            panel.title = fmt::format("a pixel is {:g} fibres wide", distance.at("pixel_width").get<double>());
            for (std::size_t k = 0; k < std::size(fields); ++k) {
                plot::Curve curve = figure.legend[k];
                for (const auto& row : distance.at("rows"))
                    if (row.at("field") == fields[k].name)
                        curve.x.push_back(row.at(key)), curve.y.push_back(row.at("relative_rmse"));
                panel.curves.push_back(std::move(curve));
            }
            panels.push_back(std::move(panel));
        }
        bench::add_panels(figure, panels.size(), cost, 1e-3, std::move(panels));
    }
    return figure;
}

struct Options {
    int pixels = 48, threads = 0;
    std::uint32_t reference = 4096;
    std::string json, figure, from, pictures;
};

nlohmann::ordered_json measure(const Options& o) {
    nlohmann::ordered_json numbers = {{"scene", "render/scenes/ball.json"}, {"pixels", o.pixels}};
    for (const double width : pixel_widths) {
        const Scene scene = scene_at(width, o.pixels);
        std::vector<std::unique_ptr<PathTracer>> tracers;
        for (const FieldName& field : fields) {
            PathOptions options;
            options.field = field.field;
            tracers.push_back(std::make_unique<PathTracer>(scene, options));
        }
        const Film reference = rendered(scene, *tracers[0], o.reference, 1000, o.threads).film;
        double mean[3];
        reference.mean(mean);
        const double level = double(luminance({float(mean[0]), float(mean[1]), float(mean[2])}));
        nlohmann::ordered_json distance = {
            {"pixel_width", width}, {"reference_samples", o.reference}, {"reference_error", reference.error()}};
        fmt::print("a pixel is {:g} fibres wide; reference: {} samples, error {:.2g}\n", width, o.reference,
                   reference.error());
        double near_cost = 0;  // squared error times seconds
        nlohmann::ordered_json rows = nlohmann::ordered_json::array();
        std::vector<nlohmann::ordered_json> of_field[std::size(fields)];
        for (const std::uint32_t samples : sample_counts) {
            double squares[std::size(fields)] = {}, seconds[std::size(fields)] = {};
            for (int seed = 1; seed <= seeds; ++seed)  // fields take turns, so that other work disturbs all alike
                for (std::size_t k = 0; k < std::size(fields); ++k) {
                    const Rendered r = rendered(scene, *tracers[k], samples, std::uint32_t(seed), o.threads);
                    squares[k] += squared_error(r.film, reference) / seeds, seconds[k] += r.seconds / seeds;
                    if (!o.pictures.empty() && seed == 1 && samples == sample_counts[1])
                        write_png(r.film, scene.picture,
                                  fmt::format("{}/{}_{:g}.png", o.pictures, fields[k].name, width));
                }
            for (std::size_t k = 0; k < std::size(fields); ++k) {
                const double error = std::sqrt(std::max(0.0, squares[k])) / level;
                if (k == 0) near_cost = squares[k] * seconds[k];
                const double speed = near_cost / (squares[k] * seconds[k]);
                fmt::print("  {:<11} {:>4} samples {:>8.2f} s  relative RMSE {:.4f}  speed at equal error {:.2f}\n",
                           fields[k].name, samples, seconds[k], error, speed);
                of_field[k].push_back({{"field", fields[k].name},
                                       {"samples", samples},
                                       {"processor_seconds", seconds[k]},
                                       {"relative_rmse", error},
                                       {"speed_at_equal_error", speed}});
            }
        }
        for (const auto& some : of_field)
            for (const auto& row : some) rows.push_back(row);
        distance["rows"] = std::move(rows);
        numbers["distances"].push_back(std::move(distance));
        if (!o.pictures.empty())
            write_png(reference, scene.picture, fmt::format("{}/reference_{:g}.png", o.pictures, width));
    }
    return numbers;
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("Near, far and multi-scale fields: error against samples and processor time");
    Options o;
    app.add_option("--pixels", o.pixels, "width and height of the pictures")->check(CLI::Range(8, 1024));
    app.add_option("--reference", o.reference, "samples per pixel of the reference")->check(CLI::Range(8, 1 << 24));
    app.add_option("--threads", o.threads, "0: all processors")->check(CLI::Range(0, 1024));
    app.add_option("--json", o.json, "write the numbers into FILE");
    app.add_option("--figure", o.figure, "draw the numbers into FILE: .svg, .png or .html");
    app.add_option("--pictures", o.pictures, "write pictures of 32 samples, and the references, into FOLDER");
    app.add_option("--from", o.from, "measure nothing: draw the numbers that --json wrote into FILE");
    CLI11_PARSE(app, argc, argv);
    try {
        const nlohmann::ordered_json numbers =
            o.from.empty() ? measure(o) : nlohmann::ordered_json::parse(std::ifstream(o.from));
        if (!o.json.empty()) std::ofstream(o.json) << numbers.dump(1) << '\n';
        if (!o.figure.empty()) bench::save(figure_of(numbers), o.figure);
    } catch (const std::exception& e) {
        fmt::print(stderr, "bench_fields: {}\n", e.what());
        return 1;
    }
    return 0;
}
