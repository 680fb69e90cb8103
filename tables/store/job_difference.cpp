#include "tables/store/job_difference.hpp"

#include <fmt/core.h>

#include <cmath>

namespace medulla::tables {
namespace {

const char* option_of(const std::string& axis) {
    if (axis == "sigma") return "--sigma-range";
    if (axis == "g") return "--g-range";
    if (axis == "absorption") return "--absorption-range";
    return axis == "h" ? "--h-range" : "--theta-range";
}

/// LO:HI:N as it is typed, in degrees for theta_i.
std::string range_text(const Axis& axis) {
    const double unit = axis.name == "theta_i" ? 180 / pi : 1;
    return fmt::format("{:.10g}:{:.10g}:{}", axis.values.front() * unit, axis.values.back() * unit, axis.size());
}

std::string table_names(const Tables& tables) {
    if (tables.azimuthal && tables.longitudinal) return "both";
    return tables.azimuthal ? "azimuthal" : "longitudinal";
}

std::string or_none(double value) { return value > 0 ? fmt::format("{:g}", value) : "none"; }

class Differences {
  public:
    void add(const std::string& option, const std::string& expected, const std::string& found) {
        if (expected == found || text_.find(option + ":") != std::string::npos) return;
        text_ += fmt::format("{}{}: expected {}, found {}", text_.empty() ? "" : "; ", option, expected, found);
    }

    void add(const Table& expected, const Table& found) {
        for (const Axis& axis : expected.axes)
            if (!axis_rule(axis.name).bins && axis.name != "side") add(axis, found);
        if (found.has_axis("absorption") && !expected.has_axis("absorption"))
            add(option_of("absorption"), "none", range_text(found.axis("absorption")));
        const std::size_t half = expected.sides();  // of the circle that --bins cuts
        add("--bins", fmt::format("{}", half * expected.bins()), fmt::format("{}", half * found.bins()));
        add("--method", expected.method, found.method);
        add("--target-error", or_none(expected.target_error), or_none(found.target_error));
        add("--time-budget", or_none(expected.time_budget), or_none(found.time_budget));
        // Both are 0 where they have no meaning, which the options above say.
        if (expected.paths > 0 && found.paths > 0)
            add("--paths", fmt::format("{}", expected.paths), fmt::format("{}", found.paths));
        if (expected.method == found.method)
            add("--seed", fmt::format("{}", expected.seed), fmt::format("{}", found.seed));
    }

    const std::string& text() const { return text_; }

  private:
    void add(const Axis& expected, const Table& table) {
        const std::string option = option_of(expected.name);
        if (!table.has_axis(expected.name)) return add(option, range_text(expected), "none");
        const Axis& found = table.axis(expected.name);
        if (found.values == expected.values) return;
        if (range_text(expected) != range_text(found)) return add(option, range_text(expected), range_text(found));
        // The same range: another --scene left other nodes of it, or other ends round to the same text.
        for (std::size_t i = 0; i < found.size(); ++i)
            if (found.values[i] != expected.values[i])
                return add(option, fmt::format("{:.17g} as node {} of {}", expected.values[i], i + 1, expected.size()),
                           fmt::format("{:.17g} (another --scene leaves other nodes)", found.values[i]));
    }

    std::string text_;
};

}  // namespace

std::string job_difference(const Tables& expected, const Tables& found) {
    Differences all;
    all.add("--table", table_names(expected), table_names(found));
    for (const TableId id : table_ids)
        if (expected[id] && found[id]) all.add(*expected[id], *found[id]);
    all.add("program", expected.program, found.program);
    return all.text();
}

}  // namespace medulla::tables
