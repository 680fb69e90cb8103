// furtable plot and furtable export: pictures of lobes, and packs and tables in other programs' forms.
#include <fmt/core.h>
#include <spawn.h>
#include <sys/wait.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "tables/pack/glsl.hpp"
#include "tables/programs/commands.hpp"
#include "tables/programs/plot.hpp"
#include "tables/store/file.hpp"

extern char** environ;  // POSIX

namespace medulla::tables {
namespace {

struct PlotWords {
    std::vector<std::string> files;
    std::string output;
};

/// Value of an axis nearest to `wanted`.
double nearest(const std::vector<Axis>& axes, const std::string& name, double wanted) {
    for (const Axis& axis : axes) {
        if (axis.name != name) continue;
        double best = axis.values[0];
        for (const double x : axis.values)
            if (std::abs(x - wanted) < std::abs(best - wanted)) best = x;
        return best;
    }
    return 0;
}

/// One panel: lobes of every file at three offsets or inclinations of one (sigma, g) and, where there is such an axis,
/// absorption.
Panel panel_of(const std::vector<std::unique_ptr<Source>>& sources, const std::vector<std::string>& names,
               TableKind kind, double sigma, double g, double absorption) {
    constexpr const char* colours[] = {"#1f4e9c", "#c2571a", "#2c8a4b"};
    const std::vector<Axis> axes = sources[0]->parameter_axes(kind);
    const bool azimuthal = kind == TableKind::azimuthal;
    Parameters at;
    at.sigma = nearest(axes, "sigma", sigma), at.g = nearest(axes, "g", g);
    at.absorption = nearest(axes, "absorption", absorption);
    Panel panel;
    panel.title = fmt::format("{}, σ {:.3g}, g {:.2g}", name_of(kind), at.sigma, at.g);
    if (azimuthal && sources[0]->absorbs()) panel.title += fmt::format(", σa {:.2g}", at.absorption);
    panel.x_label = azimuthal ? "φ [degrees]" : "θr [degrees]";
    const double positions[] = {0, azimuthal ? 0.6 : pi / 6, azimuthal ? 0.95 : pi / 3};
    for (std::size_t p = 0; p < 3; ++p) {
        if (azimuthal)
            at.h = nearest(axes, "h", positions[p]);
        else
            at.theta_i = nearest(axes, "theta_i", positions[p]);
        for (std::size_t s = 0; s < sources.size(); ++s) {
            if (!sources[s]->has(kind) || (at.absorption != 0 && !sources[s]->absorbs())) continue;
            sources[s]->check(kind, at, names[s]);
            Curve curve;
            const std::size_t bins = sources[s]->bins(kind);
            if (s == 0)
                curve.label =
                    azimuthal ? fmt::format("h {:.2g}", at.h) : fmt::format("θi {:.0f}°", at.theta_i * 180 / pi);
            curve.colour = s == 0 ? colours[p] : "#000";
            curve.dashed = s > 0;
            curve.x = exit_axis(exit_name(kind), bins).values;
            curve.y = sources[s]->lobe(kind, at, bins);
            panel.curves.push_back(std::move(curve));
        }
    }
    return panel;
}

/// SVG -> PNG by librsvg's program, which draws SVG better than we would.
void write_png(const std::string& output, const std::string& picture) {
    PendingFile pending(output);
    const std::string source = pending.temporary() + ".svg";
    write_file(source, picture);
    const std::vector<std::string> words = {"rsvg-convert", "--zoom", "2", "--output", pending.temporary(), source};
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    pid_t child = 0;
    int status = posix_spawnp(&child, "rsvg-convert", nullptr, nullptr, arguments.data(), environ);
    if (status == 0 && waitpid(child, &status, 0) < 0) status = -1;
    std::filesystem::remove(source);
    if (status != 0)
        throw Error("{}: rsvg-convert (package librsvg2-bin) could not draw it; .svg and .html need no such program",
                    output);
    pending.commit();
}

void run_plot(const PlotWords& words) {
    refuse_input(words.output, words.files);
    const std::string extension = std::filesystem::path(words.output).extension();
    if (extension != ".svg" && extension != ".png" && extension != ".html")
        throw UsageError("plot: -o expected a name that ends in .svg, .png or .html, found '{}'", words.output);
    std::vector<std::unique_ptr<Source>> sources;
    std::string title = "lobes of ";
    for (const std::string& file : words.files) {
        sources.push_back(open_source(file));
        const std::string name = std::filesystem::path(file).filename();
        title += sources.size() == 1 ? name + " (colour)" : ", " + name + " (dashed)";
    }
    const double points[][2] = {{0.5, 0.3}, {2, 0.7}, {8, 0.9}};
    std::vector<Panel> panels;
    for (const TableKind kind : lobe_kinds)
        for (const double absorption : {0, 1})
            for (const auto& point : points)
                if (sources[0]->has(kind) &&
                    (absorption == 0 || (kind == TableKind::azimuthal && sources[0]->absorbs())))
                    panels.push_back(panel_of(sources, words.files, kind, point[0], point[1], absorption));
    const std::string picture = svg(title, panels, 3);
    if (extension == ".png")
        write_png(words.output, picture);
    else if (extension == ".svg")
        write_file(words.output, picture);
    else
        write_file(words.output, "<!DOCTYPE html>\n<html lang='en'><meta charset='utf-8'><title>" + title +
                                     "</title>\n<body>\n" + picture + "</body></html>\n");
    fmt::print("{} written\n", words.output);
}

// --- export ------------------------------------------------------------------------------------------------------

struct ExportWords {
    std::string file, format, output, table = "azimuthal", name = "fur_pack";
};

/// A C++ header that holds the pack's bytes as NAME_words, NAME_size: what runtime/include/medulla/default_pack.hpp is
/// made with.
std::string cpp_header(const std::string& file, const std::string& name) {
    std::vector<unsigned char> bytes = read_pack(file);
    const std::size_t size = bytes.size();
    bytes.resize((size + 7) / 8 * 8, 0);
    std::string out =
        "// Generated by `furtable export PACK --format cpp`; do not edit.\n"
        "#pragma once\n\n#include <cstddef>\n#include <cstdint>\n\nnamespace medulla {\n\n";
    out += fmt::format("inline constexpr std::size_t {}_size = {};\n", name, size);
    out += fmt::format("// clang-format off\nalignas(16) inline constexpr std::uint64_t {}_words[{}] = {{", name,
                       bytes.size() / 8);
    for (std::size_t i = 0; i < bytes.size(); i += 8) {
        std::uint64_t word = 0;  // the pack is little-endian, and so must the machine be that uses these words
        for (std::size_t b = 8; b-- > 0;) word = word << 8 | bytes[i + b];
        out += fmt::format("{}0x{:x},", i % 64 == 0 ? "\n" : "", word);
    }
    return out + "\n};\n// clang-format on\n\n}  // namespace medulla\n";
}

/// numpy's .npy, version 1.0: the normalised lobes on the table's own axes, float32.
std::string npy(const std::string& file, const std::string& name) {
    const auto source = open_source(file);
    std::vector<TableKind> kinds = {TableKind::azimuthal};
    if (name == "longitudinal") kinds = {TableKind::longitudinal_back, TableKind::longitudinal_forward};
    if (!source->has(kinds[0])) throw Error("{}: expected a table of {} lobes, found none", file, name);
    const std::vector<Axis> axes = source->parameter_axes(kinds[0]);
    const std::size_t bins = source->bins(kinds[0]);
    std::string shape;
    std::size_t cells = 1;
    for (const Axis& axis : axes) {
        shape += fmt::format("{}, ", axis.size());
        cells *= axis.size();
    }
    if (kinds.size() == 2) shape += "2, ";
    std::string header = fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}{},), }}", shape, bins);
    header.append(63 - (10 + header.size()) % 64, ' ');
    header += '\n';
    std::string out = "\x93NUMPY\x01";
    out += '\0';
    out += static_cast<char>(header.size() & 0xff);
    out += static_cast<char>(header.size() >> 8);
    out += header;
    for (std::size_t cell = 0; cell < cells; ++cell) {
        Parameters at;
        std::size_t rest = cell;
        for (std::size_t k = axes.size(); k-- > 0; rest /= axes[k].size())
            at.set(axes[k].name, axes[k].values[rest % axes[k].size()]);
        for (const TableKind kind : kinds)
            for (const double value : source->lobe(kind, at, bins)) {
                const auto number = static_cast<float>(value);
                char raw[4];
                std::memcpy(raw, &number, 4);
                out.append(raw, 4);
            }
    }
    return out;
}

/// Names that begin with gl_ or hold two underscores are GLSL's own.
std::string glsl(const std::string& file, const std::string& name) {
    if (name.rfind("gl_", 0) == 0 || name.find("__") != std::string::npos || name.back() == '_')
        throw UsageError("--name: expected no gl_ in front, no two underscores and none at the end, found '{}'", name);
    const std::vector<unsigned char> bytes = read_pack(file);
    try {
        return glsl_source(bytes, name);
    } catch (const Error& error) {
        throw Error("{}: {}", file, error.what());
    }
}

void run_export(const ExportWords& words) {
    refuse_input(words.output, {words.file});
    if (words.format == "npy")
        write_file(words.output, npy(words.file, words.table));
    else if (words.format == "cpp")
        write_file(words.output, cpp_header(words.file, words.name));
    else
        write_file(words.output, glsl(words.file, words.name));
    fmt::print("{} written\n", words.output);
}

}  // namespace

void add_plot(CLI::App& app, Action& action) {
    add_command<PlotWords>(
        app, action, "plot", "pictures of lobes; further files are drawn dashed over the first",
        [](CLI::App& command, PlotWords& words) {
            command.add_option("FILE", words.files, "tables files or packs")->required();
            command.add_option("-o,--output", words.output, "picture: .svg, .png or .html")->required();
        },
        run_plot);
}

void add_export(CLI::App& app, Action& action) {
    add_command<ExportWords>(
        app, action, "export", "a pack as a C++ header or as GLSL, or lobes as a numpy array",
        [](CLI::App& command, ExportWords& words) {
            command.add_option("FILE", words.file, "pack (cpp, glsl), or tables file or pack (npy)")->required();
            command.add_option("--format", words.format, "of the output")
                ->required()
                ->check(CLI::IsMember({"cpp", "glsl", "npy"}));
            command.add_option("-o,--output", words.output, "file to write")->required();
            command
                .add_option(
                    "--name", words.name,
                    "for cpp: NAME_words and NAME_size in namespace medulla; for glsl: what its names begin with")
                ->check([](const std::string& name) -> std::string {
                    const auto letter = [](char c) {
                        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_';
                    };
                    bool good = !name.empty() && letter(name[0]);
                    for (const char c : name) good = good && (letter(c) || (c >= '0' && c <= '9'));
                    return good ? "" : "expected a C++ name, found '" + name + "'";
                })
                ->capture_default_str();
            command.add_option("--table", words.table, "for npy")
                ->check(CLI::IsMember({"azimuthal", "longitudinal"}))
                ->capture_default_str();
        },
        run_export);
}

}  // namespace medulla::tables
