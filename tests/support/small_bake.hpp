// A material baked in about a second: few nodes and paths, so with an error of some percent that it states.
#pragma once

#include <atomic>

#include "medulla/baked_field.hpp"
#include "tables/bake/bake.hpp"
#include "tables/parallel.hpp"

namespace medulla::test {

inline tables::FibreRequest small_fibre(const char* preset) {
    tables::FibreRequest r;
    r.material.name = preset, r.material.fur = parameters_of<3>(*find_preset(preset));
    r.paths = 30000, r.inclinations = 5, r.offsets_inside = 5, r.offsets_beyond = 2, r.rows = 20, r.columns = 32;
    r.checks = 4, r.check_paths = 100000;
    return r;
}

inline tables::FibreLight simulated(const tables::FibreRequest& request) {
    tables::FibreLight light = tables::plan_of(request);
    const std::atomic<bool> never{false};
    const std::size_t nodes = light.cells.size();
    std::vector<tables::LightCell> cells(nodes + light.checks.size());
    tables::in_parallel(cells.size(), 0, never, [&](std::size_t i) { cells[i] = tables::simulate_cell(light, i); });
    for (std::size_t i = 0; i < cells.size(); ++i) (i < nodes ? light.cells[i] : light.checks[i - nodes]) = cells[i];
    return light;
}

inline tables::BakeResult small_bake(const tables::FibreLight& light) {
    tables::BakeOptions options;
    options.functions = 8;
    return tables::bake(light, options, "test");
}

/// The bytes of a small bake of a preset, once per program.
inline const std::vector<unsigned char>& baked_preset(const char* preset) {
    static std::vector<std::pair<std::string, std::vector<unsigned char>>> made;
    for (const auto& [name, bytes] : made)
        if (name == preset) return bytes;
    made.emplace_back(preset, small_bake(simulated(small_fibre(preset))).pack);
    return made.back().second;
}

}  // namespace medulla::test
