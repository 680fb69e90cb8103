// medulla-precompute --error-map: the five-lobe model of one material against light in the fibre, as a page and as
// JSON.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "sim3d/model/error_map.hpp"
#include "tables/job/material.hpp"
#include "tables/job/progress.hpp"

namespace medulla::tables {

struct ErrorMapArguments {
    std::string fibre;   ///< a preset's name, or a material file
    std::string output;  ///< the page
    std::uint64_t paths = 100000, seed = 1;
    int threads = 0;
    ProgressMode progress = ProgressMode::automatic;
    bool json = false;
};

void run_error_map(const ErrorMapArguments& args);

/// The material that was compared, and the number of paths.
struct ErrorMapTitle {
    Material material;
    std::uint64_t paths = 0, seed = 0;  ///< of each cell
    std::size_t channels() const { return material.grey ? 1 : 3; }
    std::string channel(std::size_t c) const;  ///< "", or "red", "green", "blue"
};

/// Every number of the page (docs/truth.md).
nlohmann::ordered_json error_map_json(const ErrorMapTitle& title, const sim3d::ErrorMap& map);

/// The whole page, without links to other files.
std::string error_map_page(const ErrorMapTitle& title, const sim3d::ErrorMap& map);

}  // namespace medulla::tables
