// Figures: axes, text that comes from outside, and the script that gnuplot draws. The pictures themselves:
// tests/programs.py.
#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <sstream>

#include "plot/gnuplot.hpp"

using namespace medulla::plot;

namespace {

/// Two rows of two panels, with both kinds of legend.
Figure figure() {
    Figure f;
    f.title = "title";
    f.legend = {{"solid"}, {"dashed"}};
    for (int r = 0; r < 2; ++r) {
        Row row;
        for (int i = 0; i < 2; ++i) {
            Panel panel;
            panel.x = {"x", -180, 180, false, 90};
            panel.y = log_axis("y", 0.01, 1);
            Curve curve;
            curve.x = {-180, 0, 180}, curve.y = {0.02, 0.5, 0};
            panel.curves = {curve};
            row.panels.push_back(panel);
        }
        row.legend = {{"h = 0"}};
        f.rows.push_back(row);
    }
    return f;
}

std::size_t count(const std::string& text, const std::string& what) {
    std::size_t n = 0;
    for (std::size_t at = text.find(what); at != std::string::npos; at = text.find(what, at + 1)) ++n;
    return n;
}

}  // namespace

TEST_CASE("A logarithmic axis ends at 1, 2 or 5 times a power of ten and contains its values", "[plot]") {
    // Every decade that a table's numbers may have, and values next to the ends of steps.
    for (int decade = -12; decade <= 12; ++decade)
        for (const double digit : {1.0, 1.0000001, 1.9999999, 2.0, 3.3, 4.9999999, 5.0, 7.7, 9.9999999}) {
            const double value = digit * std::pow(10, decade);
            const Axis axis = log_axis("", value, value);
            CHECK(axis.low <= value * (1 + 1e-8));
            CHECK(axis.high >= value * (1 - 1e-8));
            CHECK(axis.low < axis.high);
            CHECK(axis.high / axis.low < 10.1);
            for (const double end : {axis.low, axis.high}) {
                const double fraction = end / std::pow(10, std::floor(std::log10(end) + 1e-9));
                CHECK(std::min({std::abs(fraction - 1), std::abs(fraction - 2), std::abs(fraction - 5)}) < 1e-6);
            }
        }
}

TEST_CASE("A logarithmic axis refuses what has no logarithm", "[plot]") {
    for (const double low : {0.0, -1.0, double(NAN), double(INFINITY), 2.0}) CHECK_THROWS(log_axis("", low, 1));
    CHECK_THROWS(log_axis("", 1, INFINITY));
    CHECK_THROWS(log_axis("", 1, NAN));
}

TEST_CASE("A symmetric axis contains its reach; of 0 it is still an axis", "[plot]") {
    for (const double reach : {0.0, 1e-9, 0.013, 0.2, 7.0, 300.0}) {
        const Axis axis = symmetric_axis("", reach);
        CHECK(axis.low == -axis.high);
        CHECK(axis.high >= reach);
        CHECK(axis.high > 0);
        CHECK(axis.step * 2 == axis.high);
    }
}

TEST_CASE("Names from outside cannot leave their quotes or act as markup", "[plot]") {
    CHECK(printable("a_b^c{d}@e&f~g\\h`i`") == "a_b^c{d}@e&f~g\\h`i`");
    CHECK(printable("line\nbreak\ttab\x7f") == "line?break?tab?");
    CHECK(printable("\xff\xce\xb8\xce") == "?\xce\xb8?");  // only the theta is UTF-8
    Figure f = figure();
    f.title = printable("it's 'quoted'\nsystem 'false'");
    const std::string script = gnuplot_script(f, Format::svg);
    CHECK(script.find("'it''s ''quoted''?system ''false'''") != std::string::npos);
    // A command of its own would begin a line.
    CHECK(script.find("\nsystem") == std::string::npos);
}

TEST_CASE("No legend stands within a panel, and no two panels overlap", "[plot]") {
    struct Box {
        double x0, x1, y0, y1;
    };
    std::vector<Box> panels, legends;
    std::istringstream lines(gnuplot_script(figure(), Format::svg));
    Box box{};
    for (std::string line; std::getline(lines, line);) {
        std::sscanf(line.c_str(), "set lmargin at screen %lf", &box.x0);
        std::sscanf(line.c_str(), "set rmargin at screen %lf", &box.x1);
        std::sscanf(line.c_str(), "set bmargin at screen %lf", &box.y0);
        std::sscanf(line.c_str(), "set tmargin at screen %lf", &box.y1);
        if (line == "unset key") panels.push_back(box);
        if (line.rfind("set key at", 0) == 0) legends.push_back(box);
    }
    REQUIRE(panels.size() == 4);
    REQUIRE(legends.size() == 3);
    const auto apart = [](const Box& a, const Box& b) {
        return a.x1 <= b.x0 || b.x1 <= a.x0 || a.y1 <= b.y0 || b.y1 <= a.y0;
    };
    for (std::size_t i = 0; i < panels.size(); ++i) {
        CHECK((panels[i].x0 < panels[i].x1 && panels[i].y0 < panels[i].y1));
        for (const Box& legend : legends) CHECK(apart(panels[i], legend));
        for (std::size_t k = 0; k < i; ++k) CHECK(apart(panels[i], panels[k]));
    }
}

TEST_CASE("A curve's points are in the script once each, and a zero leaves a logarithmic panel downwards", "[plot]") {
    const std::string script = gnuplot_script(figure(), Format::svg);
    CHECK(count(script, "-180 0.02\n") == 4);
    CHECK(count(script, "180 1e-05\n") == 4);
    CHECK(count(script, "notitle") == 4);
}

TEST_CASE("Thinned curves stay within the tolerance, and keep their ends and their peaks", "[plot]") {
    std::vector<double> x, y;
    for (int i = 0; i < 720; ++i) {
        x.push_back(i);
        y.push_back(std::sin(i / 40.0) + (i == 300 ? 5 : 0));
    }
    for (const double tolerance : {0.5, 0.01, 1e-4}) {
        const std::vector<std::size_t> kept = thinned(x, y, tolerance);
        CHECK(kept.front() == 0);
        CHECK(kept.back() == 719);
        CHECK(std::count(kept.begin(), kept.end(), std::size_t(300)) == 1);
        CHECK(kept.size() < 720);
        for (std::size_t k = 1; k < kept.size(); ++k)
            for (std::size_t i = kept[k - 1]; i <= kept[k]; ++i) {
                const double part = (x[i] - x[kept[k - 1]]) / (x[kept[k]] - x[kept[k - 1]]);
                CHECK(std::abs(y[kept[k - 1]] + part * (y[kept[k]] - y[kept[k - 1]]) - y[i]) <= tolerance * (1 + 1e-9));
            }
    }
    CHECK(thinned(x, y, -1).size() == 720);
    CHECK(thinned({}, {}, 1).empty());
    CHECK(thinned({1}, {1}, 1).size() == 1);
}

TEST_CASE("A format is what the name ends in", "[plot]") {
    CHECK(format_of("a.svg") == Format::svg);
    CHECK(format_of("a.b/c.png") == Format::png);
    CHECK(format_of("a.html") == Format::html);
    for (const char* name : {"a.jpg", "svg", ".svg", "a.svg ", ""}) CHECK_FALSE(format_of(name));
}
