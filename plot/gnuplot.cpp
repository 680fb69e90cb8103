#include "plot/gnuplot.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <optional>
#include <stdexcept>

extern char** environ;  // POSIX

namespace medulla::plot {
namespace {

// Layout [px].
constexpr double cell_width = 330, left = 62, right = 14, legend_width = 108, header = 36, legend_line = 16;
constexpr double title_height = 24, gap = 18, numbers_height = 18, label_height = 22;

/// A string constant: nothing is special between single quotes but the quote itself.
std::string quoted(const std::string& text) {
    std::string out = "'";
    for (const char c : text) out += c == '\'' ? std::string("''") : std::string(1, c);
    return out + "'";
}

const char* dash_of(Stroke stroke) {
    switch (stroke) {
        case Stroke::solid:
            return "solid";
        case Stroke::dashed:
            return "(6,4)";
        case Stroke::dotted:
            return "(1.5,3)";
        case Stroke::dash_dot:
            return "(8,3,1.5,3)";
    }
    return "solid";
}

std::string style_of(const Curve& curve) {
    return fmt::format("with {} lc rgb '{}' lw {:.3g} dt {}{}", curve.marks ? "linespoints" : "lines", curve.colour,
                       curve.width, dash_of(curve.stroke), curve.marks ? " pt 7 ps 0.45" : "");
}

/// A power of ten: "10⁻⁴".
std::string power_of_ten(int exponent) {
    constexpr const char* digits[] = {"⁰", "¹", "²", "³", "⁴", "⁵", "⁶", "⁷", "⁸", "⁹"};
    std::string out = exponent < 0 ? "10⁻" : "10";
    for (const char c : std::to_string(std::abs(exponent))) out += digits[c - '0'];
    return out;
}

/// 0.001 to 9000 as they are, others as powers of ten.
std::string number(double x) {
    const double size = std::abs(x);
    if (size == 0 || (size > 0.9e-3 && size < 9.9e3)) return fmt::format("{:.4g}", x);
    const int exponent = static_cast<int>(std::floor(std::log10(size) + 1e-9));
    const double factor = x / std::pow(10, exponent);
    const std::string power = power_of_ten(exponent);
    return std::abs(factor - 1) < 1e-6 ? power : fmt::format("{:.3g}·{}", factor, power);
}

/// The ticks of an axis as gnuplot's list; minor ones (level 1) have no number.
std::string ticks(const Axis& axis) {
    std::string out;
    const auto tick = [&](double x, bool major) {
        out += fmt::format("{}{} {:.9g} {}", out.empty() ? "" : ", ",
                           quoted(major && axis.numbers ? number(x) : std::string()), x, major ? 0 : 1);
    };
    if (!axis.log) {
        const double from = std::ceil(axis.low / axis.step - 1e-9);
        for (double i = from; i * axis.step <= axis.high + 1e-9 * axis.step; ++i) tick(i * axis.step, true);
        return out;
    }
    const double decades = std::log10(axis.high / axis.low);
    const int every = decades > 8 ? 3 : decades > 4 ? 2 : 1;
    for (int decade = static_cast<int>(std::floor(std::log10(axis.low) - 1e-9));
         std::pow(10, decade) < axis.high * 1.001; ++decade)
        for (int digit = 1; digit <= 9; ++digit) {
            const double x = digit * std::pow(10, decade);
            if (x < axis.low * 0.999 || x > axis.high * 1.001) continue;
            const bool half = digit == 2 || digit == 5;
            if (digit == 1)
                tick(x, decade % every == 0);
            else if (decades <= 4)
                tick(x, half && decades < 1.8);
        }
    return out;
}

std::string axis_text(const char* name, const Axis& axis) {
    return fmt::format(
        "set {0}range [{1:.9g}:{2:.9g}]\n{3} logscale {0}\nset {0}tics nomirror textcolor rgb '#333333' ({4})\n", name,
        axis.low, axis.high, axis.log ? "set" : "unset", ticks(axis));
}

/// The points of a curve that change the picture by more than a twentieth of a pixel; of a curve with marks, all.
std::string data_of(const Panel& panel, const Curve& curve, double height, const std::string& name) {
    const Axis& axis = panel.y;
    std::vector<double> y = curve.y, pixels(y.size());
    for (std::size_t i = 0; i < y.size(); ++i) {
        // Values that a logarithmic axis cannot show leave the panel through its lower edge.
        if (axis.log) y[i] = std::max(y[i], axis.low * 1e-3);
        pixels[i] =
            height * (axis.log ? std::log(y[i]) / std::log(axis.high / axis.low) : y[i] / (axis.high - axis.low));
    }
    std::string out = name + " << EOD\n";
    for (const std::size_t i : thinned(curve.x, pixels, curve.marks || panel.x.log ? -1 : 0.05))
        out += fmt::format("{:.6g} {:.6g}\n", curve.x[i], y[i]);
    return out + "EOD\n";
}

struct Box {
    double x0, x1, y0, y1;  ///< in the page, 0 to 1; y upwards
};

std::string margins(const Box& box) {
    return fmt::format(
        "set lmargin at screen {:.6f}\nset rmargin at screen {:.6f}\nset bmargin at screen {:.6f}\n"
        "set tmargin at screen {:.6f}\n",
        box.x0, box.x1, box.y0, box.y1);
}

std::string panel_text(const Panel& panel, double height, const Box& box) {
    std::string out, plots;
    for (std::size_t i = 0; i < panel.curves.size(); ++i) {
        const std::string name = fmt::format("$curve{}", i);
        out += data_of(panel, panel.curves[i], height, name);
        plots += fmt::format("{} {} using 1:2 {} notitle", i == 0 ? "plot" : ",", name, style_of(panel.curves[i]));
    }
    out += margins(box) + axis_text("x", panel.x) + axis_text("y", panel.y);
    out +=
        panel.x.label.empty() ? "unset xlabel\n" : fmt::format("set xlabel {} offset 0,0.4\n", quoted(panel.x.label));
    // At a fixed place, however wide the numbers are: gnuplot's own label moves with them.
    out += "unset label\n";
    if (!panel.y.label.empty())
        out += fmt::format("set label {} at screen {:.6f}, graph 0.5 center rotate by 90\n", quoted(panel.y.label),
                           box.x0 * 10 / left);
    out += panel.title.empty() ? "unset title\n" : fmt::format("set title {} offset 0,-0.6\n", quoted(panel.title));
    out += "set border 3 lw 0.7 lc rgb '#777777'\nset grid x y lt 1 lc rgb '#e4e4e4' lw 0.6\nunset key\n";
    return out + (plots.empty() ? "plot NaN notitle" : plots) + "\n";
}

/// A legend is the key of an empty plot of its own, so that it never lies over a curve.
std::string legend_text(const std::vector<Curve>& legend, const Box& box, const std::string& key) {
    if (legend.empty()) return "";
    std::string plots;
    for (const Curve& curve : legend)
        plots += fmt::format("{} NaN {} title {}", plots.empty() ? "plot" : ",", style_of(curve), quoted(curve.label));
    return margins(box) +
           "unset border\nunset xtics\nunset ytics\nunset xlabel\nunset label\nunset title\nunset grid\n" +
           "unset logscale\nset xrange [0:1]\nset yrange [0:1]\nset key " + key + "\n" + plots + "\n";
}

bool any_label(const Row& row) {
    return std::any_of(row.panels.begin(), row.panels.end(), [](const Panel& p) { return !p.x.label.empty(); });
}
bool any_number(const Row& row) {
    return std::any_of(row.panels.begin(), row.panels.end(), [](const Panel& p) { return p.x.numbers; });
}
bool any_title(const Row& row) {
    return std::any_of(row.panels.begin(), row.panels.end(), [](const Panel& p) { return !p.title.empty(); });
}
double above(const Row& row) { return any_title(row) ? title_height : gap / 2; }
double below(const Row& row) {
    return gap / 2 + (any_number(row) ? numbers_height : 0) + (any_label(row) ? label_height : 0);
}

struct CloseFile {
    void operator()(std::FILE* file) const { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

/// An open file without a name.
File scratch() {
    File file(std::tmpfile());
    if (!file) throw std::runtime_error(fmt::format("no temporary file for gnuplot: {}", std::strerror(errno)));
    return file;
}

std::string read_all(std::FILE* file) {
    std::rewind(file);
    std::string out;
    char block[1 << 16];
    for (std::size_t n; (n = std::fread(block, 1, sizeof block, file)) > 0;) out.append(block, n);
    return out;
}

/// Runs gnuplot on a script; what it drew. Scratch files instead of pipes: neither side can block the other.
std::string run_gnuplot(const std::string& script) {
    const File input = scratch(), output = scratch(), messages = scratch();
    if (std::fwrite(script.data(), 1, script.size(), input.get()) != script.size() || std::fflush(input.get()) != 0)
        throw std::runtime_error(fmt::format("the script for gnuplot cannot be written: {}", std::strerror(errno)));
    std::rewind(input.get());

    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_adddup2(&actions, fileno(input.get()), 0);
    posix_spawn_file_actions_adddup2(&actions, fileno(output.get()), 1);
    posix_spawn_file_actions_adddup2(&actions, fileno(messages.get()), 2);
    std::string program = "gnuplot", plain = "--default-settings";  // no start-up file of the user's
    char* arguments[] = {program.data(), plain.data(), nullptr};
    pid_t child = 0;
    const int failed = posix_spawnp(&child, "gnuplot", &actions, nullptr, arguments, environ);
    posix_spawn_file_actions_destroy(&actions);
    if (failed == ENOENT)
        throw std::runtime_error("gnuplot, which draws the pictures, is not installed (Debian's package: gnuplot-nox)");
    if (failed != 0) throw std::runtime_error(fmt::format("gnuplot cannot be started: {}", std::strerror(failed)));
    int status = 0;
    while (waitpid(child, &status, 0) < 0)
        if (errno != EINTR) throw std::runtime_error(fmt::format("gnuplot: {}", std::strerror(errno)));
    std::string picture = read_all(output.get());
    if (status != 0 || picture.empty()) {
        std::string text = read_all(messages.get());  // the last line says what is wrong
        text.erase(text.find_last_not_of(" \n") + 1);
        text.erase(0, text.find_last_of('\n') + 1);
        throw std::runtime_error(text.empty() ? "gnuplot failed" : "gnuplot failed: " + text);
    }
    return picture;
}

}  // namespace

std::optional<Format> format_of(const std::string& path) {
    const std::pair<const char*, Format> endings[] = {
        {".svg", Format::svg}, {".png", Format::png}, {".html", Format::html}};
    for (const auto& [ending, format] : endings) {
        const std::size_t size = std::strlen(ending);
        if (path.size() > size && path.compare(path.size() - size, size, ending) == 0) return format;
    }
    return {};
}

std::string gnuplot_script(const Figure& figure, Format format) {
    std::size_t columns = 1;
    bool side = false;
    // gnuplot breaks a legend of more entries than this into two lines.
    const double legend_height = figure.legend.empty() ? 0 : 10 + legend_line * (figure.legend.size() > 4 ? 2 : 1);
    double height = header + legend_height;
    for (const Row& row : figure.rows) {
        columns = std::max(columns, row.panels.size());
        side = side || !row.legend.empty();
        height += above(row) + row.height + below(row);
    }
    const double width = cell_width * static_cast<double>(columns) + (side ? legend_width : 0);

    std::string out = "set encoding utf8\n";
    if (format == Format::png)
        out += fmt::format(
            "set terminal pngcairo noenhanced size {:.0f},{:.0f} fontscale 2 linewidth 2 pointscale 2 dashlength 1.5 "
            "font 'DejaVu "
            "Sans,10'\n",
            2 * width, 2 * height);
    else
        out += fmt::format(
            "set terminal svg noenhanced size {:.0f},{:.0f} background rgb 'white' font 'DejaVu "
            "Sans,Helvetica,sans-serif,11'\n",
            width, height);
    out += fmt::format("set tics nomirror scale 0.4\nset samples 2\nset multiplot title {} font ',14' offset 0,-0.3\n",
                       quoted(figure.title));
    const auto box = [&](double x0, double x1, double top, double bottom) {
        return Box{x0 / width, x1 / width, 1 - bottom / height, 1 - top / height};
    };
    double y = header;
    if (!figure.legend.empty()) {
        out += legend_text(figure.legend, box(0, width, y, y + legend_height),
                           fmt::format("at screen 0.5,{:.6f} center center horizontal Left reverse samplen 3 width 1",
                                       1 - (y + legend_height / 2) / height));
        y += legend_height;
    }
    for (const Row& row : figure.rows) {
        y += above(row);
        double x = 0;
        for (const Panel& panel : row.panels) {
            out += panel_text(panel, row.height, box(x + left, x + cell_width - right, y, y + row.height));
            x += cell_width;
        }
        out += legend_text(row.legend, box(x, width, y, y + row.height),
                           fmt::format("at screen {:.6f},{:.6f} left top vertical Left reverse samplen 2",
                                       (x - right / 2) / width, 1 - y / height));
        y += row.height + below(row);
    }
    return out + "unset multiplot\n";
}

std::string draw(const Figure& figure, Format format) {
    const std::string picture = run_gnuplot(gnuplot_script(figure, format));
    if (format != Format::html) return picture;
    const std::size_t start = picture.find("<svg");
    if (start == std::string::npos) throw std::runtime_error("gnuplot failed: found no SVG in what it drew");
    return "<!DOCTYPE html>\n<html lang='en'>\n<meta charset='utf-8'>\n<title>furtable plot</title>\n<body>\n" +
           picture.substr(start) + "</body>\n</html>\n";
}

}  // namespace medulla::plot
