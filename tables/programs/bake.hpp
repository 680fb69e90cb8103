// medulla-precompute --fibre, furtable compress and furtable info of one material's light.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "medulla/baked.hpp"
#include "tables/job/material.hpp"
#include "tables/job/progress.hpp"
#include "tables/store/output.hpp"
#include "tables/store/tables_file.hpp"

namespace medulla::tables {

/// A material as --fibre names it: a preset, or a file. @param is_preset set accordingly
Material fibre_named(const std::string& fibre, bool& is_preset);

struct SimulateFibreArguments {
    std::string fibre, output;  ///< output empty: named after the fibre
    std::optional<std::uint64_t> paths;
    std::optional<double> target_error;
    std::optional<std::size_t> bins;  ///< of phi
    std::uint64_t seed = 1;
    int threads = 0;
    ProgressMode progress = ProgressMode::automatic;
    Compression compression = Compression::zstd;
    bool resume = false, json = false;
};
void run_simulate_fibre(const SimulateFibreArguments& args);

struct BakeArguments {
    std::string input;
    std::optional<int> rank;
    std::optional<double> max_error;
    std::optional<std::size_t> max_bytes;
    std::uint64_t seed = 1;
    std::optional<int> sweeps;
    bool json = false;
};
void run_bake(const BakeArguments& args, const Output& output);

/// What a baked material is, for `furtable info`. Throws Error unless it opens.
nlohmann::ordered_json baked_info(const std::string& path);
void print_baked_info(const nlohmann::ordered_json& info);

/// What the light of a fibre is, likewise.
nlohmann::ordered_json fibre_info(const std::string& path);
void print_fibre_info(const nlohmann::ordered_json& info);

}  // namespace medulla::tables
