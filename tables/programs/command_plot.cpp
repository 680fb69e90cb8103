// furtable plot and furtable export: pictures of lobes, and packs and tables in other programs' forms.
#include <fcntl.h>
#include <fmt/core.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmath>
#include <cstring>
#include <filesystem>

#include "tables/pack/glsl.hpp"
#include "tables/programs/commands.hpp"
#include "tables/programs/plot.hpp"
#include "tables/store/file.hpp"
#include "tables/store/json_text.hpp"
#include "tables/store/output.hpp"

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

/// A file's name as text of XML: no markup, no bytes that XML does not hold.
std::string xml_name(const std::string& path) {
    std::string text;
    for (const char c : json_name(std::filesystem::path(path).filename().string()))
        if (static_cast<unsigned char>(c) < ' ' || c == 127)
            text += '?';
        else if (c == '&' || c == '<' || c == '>')
            text += c == '&' ? "&amp;" : (c == '<' ? "&lt;" : "&gt;");
        else
            text += c;
    return text;
}

/// Runs a program without a shell, its messages unseen; whether it ended well.
bool runs(const std::vector<std::string>& words) {
    std::vector<char*> arguments;
    for (const std::string& word : words) arguments.push_back(const_cast<char*>(word.c_str()));
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
    pid_t child = 0;
    int status = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    if (status == 0 && waitpid(child, &status, 0) < 0) status = -1;
    return status == 0;
}

/// SVG -> PNG by librsvg's program, which draws SVG better than we would.
std::vector<unsigned char> png(const std::string& picture, const std::string& output) {
    std::string folder = (std::filesystem::temp_directory_path() / "furtable-XXXXXX").string();
    if (::mkdtemp(folder.data()) == nullptr) throw Error("{}: cannot be made: {}", folder, std::strerror(errno));
    const struct Removed {
        std::string folder;
        ~Removed() {
            std::error_code ignored;
            std::filesystem::remove_all(folder, ignored);
        }
    } removed{folder};
    const std::string from = folder + "/picture.svg", to = folder + "/picture.png";
    write_file(from, picture);
    if (!runs({"rsvg-convert", "--zoom", "2", "--output", to, from}))
        throw Error("{}: rsvg-convert (package librsvg2-bin) could not draw it; .svg and .html need no such program",
                    output);
    return read_file(to);
}

void run_plot(const PlotWords& words) {
    const std::string extension = std::filesystem::path(words.output).extension();
    if (extension != ".svg" && extension != ".png" && extension != ".html")
        throw UsageError("plot: -o expected a name that ends in .svg, .png or .html, found '{}'", words.output);
    const Output output(words.output, words.files);
    print_messages();
    std::vector<std::unique_ptr<Source>> sources;
    std::string title = "lobes of ";
    for (const std::string& file : words.files) {
        sources.push_back(open_source(file));
        const std::string name = xml_name(file);
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
    if (extension == ".png") {
        const std::vector<unsigned char> pixels = png(picture, words.output);
        output.write(pixels.data(), pixels.size());
    } else if (extension == ".svg") {
        output.write(picture);
    } else {
        output.write("<!DOCTYPE html>\n<html lang='en'><meta charset='utf-8'><title>" + title + "</title>\n<body>\n" +
                     picture + "</body></html>\n");
    }
    print("{} written\n", words.output);
}

// --- export ------------------------------------------------------------------------------------------------------

struct ExportWords {
    std::string file, format, output, table = "azimuthal", name = "fur_pack";
};

/// A C++ header that holds the pack's bytes as medulla::NAME_words, NAME_size: what medulla/default_pack.hpp is made
/// with. Its namespace and its guard carry the pack's checksum: one pack twice is there once, and two packs of one name
/// are two for the linker.
std::string cpp_header(const std::string& file, const std::string& name) {
    std::vector<unsigned char> bytes = read_pack(file);
    const std::string mark = fmt::format("{:016x}", pack_checksum(bytes.data(), bytes.size()));
    const std::size_t size = bytes.size();
    bytes.resize((size + 7) / 8 * 8, 0);
    std::string out = fmt::format(
        "// Generated by `furtable export PACK --format cpp`; do not edit.\n"
        "#pragma once\n\n#include <cstddef>\n#include <cstdint>\n\n"
        "#ifndef MEDULLA_PACK_{0}_{1}\n#define MEDULLA_PACK_{0}_{1}\n\n"
        "namespace medulla {{\ninline namespace pack_{1} {{\n\n"
        "inline constexpr std::size_t {0}_size = {2};\n"
        "// clang-format off\nalignas(16) inline constexpr std::uint64_t {0}_words[{3}] = {{",
        name, mark, size, bytes.size() / 8);
    for (std::size_t i = 0; i < bytes.size(); i += 8) {
        std::uint64_t word = 0;  // the pack is little-endian, and so must the machine be that uses these words
        for (std::size_t b = 8; b-- > 0;) word = word << 8 | bytes[i + b];
        out += fmt::format("{}0x{:x},", i % 64 == 0 ? "\n" : "", word);
    }
    return out +
           fmt::format("\n}};\n// clang-format on\n\n}}  // namespace pack_{}\n}}  // namespace medulla\n\n#endif\n",
                       mark);
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

std::string glsl(const std::string& file, const std::string& name) {
    const std::vector<unsigned char> bytes = read_pack(file);
    try {
        return glsl_source(bytes, name);
    } catch (const Error& error) {
        throw Error("{}: {}", file, error.what());
    }
}

/// What names are made of is followed by _words, _size, _azimuthal ..: no keyword, but what the languages keep for
/// themselves.
void check_name_of(const std::string& format, const std::string& name) {
    const bool reserved = name.find("__") != std::string::npos || name.back() == '_';
    if (format == "glsl" && (reserved || name.rfind("gl_", 0) == 0))
        throw UsageError("--name: expected no gl_ in front, no two underscores and none at the end, found '{}'", name);
    if (format == "cpp" && (reserved || name[0] == '_'))
        throw UsageError("--name: expected no two underscores, none in front and none at the end, found '{}'", name);
}

void run_export(const ExportWords& words) {
    check_name_of(words.format, words.name);
    const Output output(words.output, {words.file});
    print_messages();
    if (words.format == "npy")
        output.write(npy(words.file, words.table));
    else if (words.format == "cpp")
        output.write(cpp_header(words.file, words.name));
    else
        output.write(glsl(words.file, words.name));
    print("{} written\n", words.output);
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
