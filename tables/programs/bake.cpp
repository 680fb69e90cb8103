#include "tables/programs/bake.hpp"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "tables/bake/bake.hpp"
#include "tables/bake/baked_file.hpp"
#include "tables/bake/fibre_job.hpp"
#include "tables/error.hpp"
#include "tables/programs/program.hpp"
#include "tables/store/file.hpp"
#include "tables/store/json_text.hpp"
#include "tables/streams.hpp"

namespace medulla::tables {
namespace {

constexpr double degrees = 180 / pi;

double seconds_since(std::chrono::steady_clock::time_point start) {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

nlohmann::ordered_json material_json(const FurParameters<3>& p) {
    const auto number = [](float x) { return std::stod(fmt::format("{}", x)); };  // 0.88, not the nearest float
    const auto angle = [](float x) { return std::stod(fmt::format("{:.6g}", static_cast<double>(x) * degrees)); };
    return {{"eta", number(p.eta)},
            {"kappa", number(p.kappa)},
            {"alpha", angle(p.alpha)},
            {"beta_m", angle(p.beta_m)},
            {"beta_n", angle(p.beta_n)},
            {"layers", number(p.layers)},
            {"sigma_ca", {number(p.sigma_ca[0]), number(p.sigma_ca[1]), number(p.sigma_ca[2])}},
            {"sigma_ms", number(p.sigma_ms)},
            {"sigma_ma", number(p.sigma_ma)},
            {"g", number(p.g)}};
}

std::string material_text(const nlohmann::ordered_json& m) {
    std::string text;
    for (const auto& [name, value] : m.items())
        text += fmt::format("{}{} {}", text.empty() ? "" : ", ", name, value.dump());
    return text;
}

}  // namespace

Material fibre_named(const std::string& fibre, bool& is_preset) {
    is_preset = find_preset(fibre.c_str()) != nullptr;
    if (is_preset) return preset_material(fibre, "--fibre");
    if (std::filesystem::exists(fibre)) return read_material(fibre);
    std::string names;
    for (const FurPreset& preset : fur_presets) names += std::string(names.empty() ? "" : ", ") + preset.name;
    throw Error("--fibre: expected a material file or one of {}; found '{}'", names, fibre);
}

void run_simulate_fibre(const SimulateFibreArguments& args) {
    FibreJob job;
    bool is_preset = false;
    job.request.material = fibre_named(args.fibre, is_preset);
    job.where = args.fibre;
    std::string stem = args.fibre.substr(args.fibre.rfind('/') + 1);
    if (stem.size() > 5 && stem.compare(stem.size() - 5, 5, ".json") == 0) stem.resize(stem.size() - 5);
    job.output = args.output.empty() ? stem + ".h5" : args.output;
    if (!is_preset) job.inputs = {args.fibre};
    FibreRequest& r = job.request;
    if (args.paths) r.paths = *args.paths;
    if (args.target_error) r.target_error = *args.target_error;
    r.seed = args.seed;
    if (args.bins) r.columns = *args.bins, r.rows = *args.bins * 5 / 8;
    job.resume = args.resume, job.threads = args.threads, job.progress = args.progress;
    job.compression = args.compression;
    if (!args.json) print_messages();
    const auto start = std::chrono::steady_clock::now();
    const FibreJobReport report = run_fibre_job(job);
    const double seconds = seconds_since(start);
    if (args.json) {
        const nlohmann::ordered_json json = {{"output", json_name(job.output)},
                                             {"cells", report.cells},
                                             {"kept_before", report.kept},
                                             {"standard_error", report.noise},
                                             {"seconds", seconds}};
        return print("{}\n", json_line(json));
    }
    if (report.was_complete) return print("{} is complete\n", job.output);
    print("{} written in {}: {}, standard error of a lobe {:.2g}; next: furtable compress {}\n", job.output,
          duration_text(seconds), counted(report.cells, "cell"), report.noise, job.output);
}

void run_bake(const BakeArguments& args, const Output& output) {
    BakeOptions options;
    if (args.rank) options.functions = *args.rank;
    if (options.functions % 4 != 0 || options.functions > static_cast<int>(max_exit_functions))
        throw UsageError("--rank: expected a multiple of 4 up to {} for the light of a fibre, found {}",
                         max_exit_functions, options.functions);
    options.max_error = args.max_error, options.max_bytes = args.max_bytes;
    options.seed = args.seed;
    if (args.sweeps) options.sweeps = *args.sweeps;
    const FibreLight light = read_fibre(args.input);
    const BakeResult result = bake(light, options, json_name(args.input.substr(args.input.rfind('/') + 1)));
    output.write(result.pack.data(), result.pack.size());
    if (args.json) {
        const nlohmann::ordered_json json = {{"output", json_name(output.path())},
                                             {"bytes", result.pack.size()},
                                             {"seconds", result.seconds},
                                             {"functions", result.functions},
                                             {"sweeps", result.sweeps},
                                             {"relative_l2_of_functions_with_noise", result.fit},
                                             {"relative_l2_of_input_noise", result.noise},
                                             {"relative_l2",
                                              {{"median", result.errors.median},
                                               {"worst", result.errors.worst},
                                               {"worst_theta_i", result.errors.worst_theta_i},
                                               {"worst_h", result.errors.worst_h},
                                               {"lobes", result.errors.lobes}}}};
        return print("{}\n", json_line(json));
    }
    print(
        "{} exit functions and their mirror images; {} lobes of independent paths: relative L2 error {:.2g} (median), "
        "{:.2g} (worst, at theta_i {:.0f} degrees, h {:.2f})\n",
        result.functions, result.errors.lobes, result.errors.median, result.errors.worst,
        result.errors.worst_theta_i * degrees, result.errors.worst_h);
    print("{}: {} bytes in {:.1f} s\n", output.path(), result.pack.size(), result.seconds);
}

nlohmann::ordered_json baked_info(const std::string& path) {
    const std::vector<unsigned char> bytes = read_baked(path);
    const BakedMaterial material = open_baked(bytes.data(), bytes.size()).material;
    const BakedHeader& h = material.header;
    const auto* text = reinterpret_cast<const char*>(bytes.data()) + h.text_offset;
    return {{"file", json_name(path)},
            {"kind", "baked material"},
            {"format_version", baked_version},
            {"bytes", bytes.size()},
            {"material", material_json(material.parameters())},
            {"functions", h.functions},
            {"exit_nodes", {{"theta_r", h.rows}, {"phi", h.columns}}},
            {"nodes", {{"theta_i", h.inclinations}, {"h", material.offsets()}, {"sigma_ca", h.sigma}}},
            {"relative_l2", {{"median", h.median_error}, {"worst", h.worst_error}}},
            {"provenance", parse_json<nlohmann::ordered_json>(text, text + h.text_bytes, path + ": provenance")}};
}

void print_baked_info(const nlohmann::ordered_json& info) {
    print("  material: {}\n", material_text(info["material"]));
    print("  {} exit functions of {} x {} nodes (theta_r, phi), and their mirror images\n",
          info["functions"].get<int>(), info["exit_nodes"]["theta_r"].get<int>(), info["exit_nodes"]["phi"].get<int>());
    print("  coefficients at {} x {} nodes (theta_i, |h|) and sigma_ca {}\n", info["nodes"]["theta_i"].get<int>(),
          info["nodes"]["h"].get<int>(), info["nodes"]["sigma_ca"].dump());
    print("  relative L2 error of scattered lobes: median {:.2g}, worst {:.2g}\n",
          info["relative_l2"]["median"].get<double>(), info["relative_l2"]["worst"].get<double>());
    print("  provenance: {}\n", json_line(info["provenance"]));
}

nlohmann::ordered_json fibre_info(const std::string& path) {
    const FibreLight light = read_fibre(path);
    const FibreRequest& r = light.request;
    nlohmann::ordered_json json = {{"file", json_name(path)},
                                   {"kind", "light of a fibre"},
                                   {"program", light.program},
                                   {"name", r.material.name},
                                   {"material", material_json(r.material.fur)},
                                   {"seed", r.seed},
                                   {"paths", r.paths}};
    if (r.target_error > 0) json["target_error"] = r.target_error;
    json["nodes"] = {
        {"theta_i", r.inclinations}, {"h", r.offsets_inside + r.offsets_beyond}, {"sigma_ca", light.sigma_ca}};
    json["bins"] = {{"theta_r", r.rows}, {"phi", r.columns}};
    json["checks"] = r.checks;
    json["standard_error"] = median_noise(light);
    return json;
}

void print_fibre_info(const nlohmann::ordered_json& info) {
    print("  material: {}\n", material_text(info["material"]));
    print("  {} x {} nodes (theta_i, |h|), sigma_ca {}, {} x {} bins (theta_r, phi); {} paths each, seed {}\n",
          info["nodes"]["theta_i"].get<int>(), info["nodes"]["h"].get<int>(), info["nodes"]["sigma_ca"].dump(),
          info["bins"]["theta_r"].get<int>(), info["bins"]["phi"].get<int>(), info["paths"].get<std::uint64_t>(),
          info["seed"].get<std::uint64_t>());
    print("  standard error of a lobe: {:.2g}; {} more to check a bake with\n", info["standard_error"].get<double>(),
          info["checks"].get<int>());
}

}  // namespace medulla::tables
