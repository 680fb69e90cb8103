// fur-render: a scene file to a picture. docs/render.md.
#include <fcntl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstring>
#include <nlohmann/json.hpp>

#include "medulla/fur_parameters.hpp"
#include "render/error.hpp"
#include "render/file.hpp"
#include "render/image_file.hpp"
#include "render/render.hpp"

namespace {

using namespace medulla::render;

/// On standard error, where a message may be lost (fmt::print would throw).
void say(const std::string& text) { std::fputs(text.c_str(), stderr); }

enum class ProgressMode { automatic, bar, plain, none };

/// Share done and time left, on standard error.
class Progress {
  public:
    explicit Progress(ProgressMode mode) : mode_(mode) {
        if (mode_ == ProgressMode::automatic) mode_ = isatty(2) != 0 ? ProgressMode::bar : ProgressMode::plain;
    }
    ~Progress() {
        if (mode_ == ProgressMode::bar && shown_) std::fputc('\n', stderr);
    }
    void operator()(double share) {
        if (mode_ == ProgressMode::none) return;
        const auto now = std::chrono::steady_clock::now();
        if (!shown_ && first_ < 0) first_ = share;
        const double period = mode_ == ProgressMode::bar ? 0.2 : 10;
        if (share < 1 && std::chrono::duration<double>(now - printed_).count() < period) return;
        if (finished_) return;
        printed_ = now, shown_ = true, finished_ = share >= 1;
        const double gone = std::chrono::duration<double>(now - start_).count();
        const double left = share > first_ ? gone * (1 - share) / (share - first_) : 0;
        const std::string text = fmt::format("{:3.0f} %, {:.0f} s, {:.0f} s left", 100 * share, gone, left);
        const int full = int(40 * share);
        say(mode_ == ProgressMode::plain ? text + "\n"
                                         : fmt::format("\r[{:#<{}}{:.<{}}] {}   ", "", full, "", 40 - full, text));
    }

  private:
    ProgressMode mode_;
    std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now(),
                                          printed_ = start_ - std::chrono::hours(1);
    double first_ = -1;
    bool shown_ = false, finished_ = false;
};

/// Processor time of all threads so far [s].
double processor_seconds() {
    rusage use{};
    getrusage(RUSAGE_SELF, &use);
    return double(use.ru_utime.tv_sec) + 1e-6 * double(use.ru_utime.tv_usec);
}

std::uint32_t mask_of(const std::vector<std::string>& names) {
    std::uint32_t mask = 0;
    for (const std::string& name : names)
        for (int k = 0; k < medulla::all_lobe_count; ++k)
            if (name == medulla::lobe_names[k]) mask |= 1u << k;
    return mask;
}

struct Options {
    std::string scene, field = "near", model = "fur", tone, layer_pngs;
    std::vector<std::string> out;
    std::vector<std::string> lobes;
    RenderOptions render;
    int samples = 0, width = 0, height = 0;
    double exposure = 0, density = 1;
    bool json = false, no_light_sampling = false, layers = false;
    ProgressMode progress = ProgressMode::automatic;
};

void run(const Options& o, const CLI::App& app) {
    Scene scene = read_scene(o.scene);
    if (o.width > 0) scene.picture.width = o.width;
    if (o.height > 0) scene.picture.height = o.height;
    if (app.count("--exposure") > 0) scene.picture.exposure = float(o.exposure);
    if (!o.tone.empty()) scene.picture.filmic = o.tone == "filmic";
    for (Object& object : scene.objects)
        for (Layer& layer : object.coat) layer.density *= float(o.density);
    for (Strands& strands : scene.strands) thin(strands, o.density);

    RenderOptions options = o.render;
    options.path.field = o.field == "near"  ? FieldChoice::one_offset
                         : o.field == "far" ? FieldChoice::whole_width
                                            : FieldChoice::multiscale;
    for (std::size_t i = 0; i < std::size(model_names); ++i)
        if (o.model == model_names[i]) options.path.model = static_cast<FibreModel>(i);
    options.path.sample_lights = !o.no_light_sampling;
    if (!o.lobes.empty()) options.path.lobes = mask_of(o.lobes);
    const bool open_ended = options.seconds > 0 || options.error > 0;
    options.samples = o.samples > 0 ? std::uint32_t(o.samples) : open_ended ? 1u << 20 : 64;
    const bool layers = o.layers || !o.layer_pngs.empty();
    options.unfinished = o.out.front() + ".unfinished";
    options.key =
        fmt::format("{}\n{} {} {} {} {} {} {} {} {} {} {}\n{}", MEDULLA_VERSION, scene.picture.width,
                    scene.picture.height, o.field, o.model, options.path.averaged_vertices, options.path.lobes,
                    o.density, options.path.clamp, options.seed, options.path.sample_lights, layers, scene.text);

    const auto start = std::chrono::steady_clock::now();
    const PathTracer tracer(scene, options.path);
    const double building = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    Film film(scene.picture.width, scene.picture.height, layers);
    Report report;
    const double processor_before = processor_seconds();
    {
        Progress progress(o.progress);
        report = render(tracer, options, film, [&](double share) { progress(share); });
    }
    const double processor = std::max(1e-9, processor_seconds() - processor_before);
    for (const std::string& out : o.out) {
        if (ends_with(out, ".png"))
            write_png(film, scene.picture, out);
        else
            write_exr(film, out);
    }
    if (!o.layer_pngs.empty()) write_layer_pngs(film, scene.picture, o.layer_pngs);
    std::remove(options.unfinished.c_str());

    const Counts& n = report.counts;
    const double seconds = std::max(report.seconds, 1e-9), all = std::max(1.0, double(n.all));
    const double traversal = double(n.traversal) / all, shading = double(n.shading) / all;
    const std::size_t strands = tracer.geometry().strand_count(), bytes = tracer.geometry().bytes();
    double mean[3];
    film.mean(mean);
    if (o.json) {
        nlohmann::json json = {{"mean", {mean[0], mean[1], mean[2]}},
                               {"seconds", report.seconds},
                               {"vertices_per_second", double(n.vertices) / seconds},
                               {"processor_seconds", processor},
                               {"nonfinite", film.nonfinite},
                               {"clamped", n.clamped},
                               {"samples", film.samples},
                               {"error", film.error()},
                               {"building_seconds", building},
                               {"strands", strands},
                               {"geometry_bytes", bytes}};
        if (options.stats) {
            json["rays"] = n.rays, json["vertices"] = n.vertices;
            json["traversal"] = traversal, json["shading"] = shading;
        }
        fmt::print("{}\n", json.dump());
        return;
    }
    fmt::print("{}: {} samples per pixel, {:.1f} s, mean {:.4f} {:.4f} {:.4f}, error {:.2g}\n", fmt::join(o.out, ", "),
               film.samples, report.seconds, mean[0], mean[1], mean[2], film.error());
    if (film.nonfinite > 0) fmt::print("{} samples were not finite and count as black\n", film.nonfinite);
    if (n.clamped > 0) fmt::print("{} path vertices had parameters out of range, which were clamped\n", n.clamped);
    if (!options.stats) return;
    fmt::print("{} strands, {:.0f} MB in Embree ({:.0f} bytes a strand), built in {:.1f} s\n", strands,
               double(bytes) * 1e-6, double(bytes) / double(std::max<std::size_t>(1, strands)), building);
    fmt::print(
        "{} rays, {} path vertices: {:.2f} M vertices/s, {:.2f} M per second of one processor; {:.0f} % traversal, "
        "{:.0f} % shading\n",
        n.rays, n.vertices, double(n.vertices) / seconds * 1e-6, double(n.vertices) / processor * 1e-6, 100 * traversal,
        100 * shading);
}

}  // namespace

int main(int argc, char** argv) {
    CLI::App app("fur-render: renders a scene of fur by path tracing with medulla's runtime (docs/render.md)");
    app.set_version_flag("--version", "medulla " MEDULLA_VERSION);
    Options o;
    app.add_option("scene", o.scene, "scene file (JSON)")->required();
    app.add_option("-o", o.out, "picture: .png (tone curve, sRGB) or .exr (linear radiance); may be given twice")
        ->required()
        ->allow_extra_args(false);
    app.add_option("--spp", o.samples, "samples per pixel (64; no limit with --time or --error)")
        ->check(CLI::Range(1, 1 << 24));
    app.add_option("--time", o.render.seconds, "stop after so many seconds")->check(CLI::Range(0.001, 1e9));
    app.add_option("--error", o.render.error, "stop at this RMS standard error of the pixels over the mean")
        ->check(CLI::Range(1e-6, 1e3));
    app.add_option("--field", o.field,
                   "near: one offset; far: the fibre's whole width; multiscale: what the pixel covers")
        ->check(CLI::IsMember({"near", "far", "multiscale"}))
        ->capture_default_str();
    app.add_option("--model", o.model, "by which fibres scatter, with the materials' parameters (docs/models.md)")
        ->check(CLI::IsMember(std::vector<std::string>(std::begin(model_names), std::end(model_names))))
        ->capture_default_str();
    app.add_option("--lobes", o.lobes, "by which fibres scatter, of R,TT,TRT,TTs,TRTs,residual; all")
        ->delimiter(',')
        ->check(
            CLI::IsMember(std::vector<std::string>(std::begin(medulla::lobe_names), std::end(medulla::lobe_names))));
    app.add_option("--width", o.width, "pixels, in place of the scene's")->check(CLI::Range(1, 16384));
    app.add_option("--height", o.height, "pixels, in place of the scene's")->check(CLI::Range(1, 16384));
    app.add_option("--exposure", o.exposure, "stops, in place of the scene's")->check(CLI::Range(-30, 30));
    app.add_option("--tone", o.tone, "the PNG's curve, in place of the scene's")
        ->check(CLI::IsMember({"filmic", "srgb"}));
    app.add_option("--clamp", o.render.path.clamp,
                   "most that one vertex after the first may add: fewer fireflies, biased; 0: off")
        ->check(CLI::Range(0.0, 1e9));
    app.add_option("--density", o.density, "times the coats' densities: below 1 for drafts")
        ->check(CLI::Range(1e-6, 1e3));
    app.add_option("--threads", o.render.threads, "0: all processors")->check(CLI::Range(0, 1024));
    app.add_option("--seed", o.render.seed, "another seed, other noise");
    app.add_flag("--resume", o.render.resume, "go on from OUT.unfinished, which a killed run leaves");
    app.add_flag("--layers", o.layers, "the EXR gets lobes, direct and indirect light, normals, depth and more");
    app.add_option(
        "--layer-pictures", o.layer_pngs,
        "write PREFIXTTs.png and so on: one PNG for each lobe of the first vertex, direct and indirect light");
    app.add_option("--averaged-vertices", o.render.path.averaged_vertices,
                   "of a path that --field multiscale averages; later ones take the offset of the ray's hit")
        ->check(CLI::Range(1, 1000000))
        ->capture_default_str();
    app.add_flag("--no-light-sampling", o.no_light_sampling, "find lights by scattering alone (reference)");
    const std::map<std::string, ProgressMode> modes{{"auto", ProgressMode::automatic},
                                                    {"bar", ProgressMode::bar},
                                                    {"plain", ProgressMode::plain},
                                                    {"none", ProgressMode::none}};
    app.add_option("--progress", o.progress, "auto, bar, plain or none")->transform(CLI::CheckedTransformer(modes));
    app.add_flag("--json", o.json, "one JSON object on standard output");
    app.add_flag("--stats", o.render.stats, "rays, speed and shares of the time");
    for (int stream = 0; stream < 3; ++stream)  // one that is closed: no picture gets its number
        if (fcntl(stream, F_GETFD) < 0 && open("/dev/null", O_RDWR) != stream) return 1;
    for (int i = 1; i < argc; ++i)
        if (argv[i][0] == 0) {  // CLI11 2.1 hangs on some of them
            say(fmt::format("fur-render: option number {} is empty\n", i));
            return 2;
        }
    try {
        app.parse(argc, argv);
        for (const std::string& out : o.out)
            if (!ends_with(out, ".png") && !ends_with(out, ".exr"))
                throw CLI::ValidationError("-o", "expected a name that ends in .png or .exr, found " + out);
        if (!o.lobes.empty() && o.model != "fur" && o.model != "eq12")
            throw CLI::ValidationError("--lobes", "expected --model fur or eq12, found " + o.model);
        if (o.layers &&
            std::none_of(o.out.begin(), o.out.end(), [](const std::string& s) { return ends_with(s, ".exr"); }))
            throw CLI::ValidationError("--layers", "expected an -o that ends in .exr");
    } catch (const CLI::Success& e) {
        return app.exit(e);
    } catch (const CLI::ParseError& e) {
        say(fmt::format("fur-render: {}\n", e.what()));
        return 2;
    }
    try {
        run(o, app);
        if (std::fflush(stdout) != 0) throw Error("standard output: cannot be written: {}", std::strerror(errno));
    } catch (const std::exception& e) {
        say(fmt::format("fur-render: {}\n", e.what()));
        return 1;
    }
    return 0;
}
