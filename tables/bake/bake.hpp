// Simulated light of a fibre -> a baked material (medulla/baked.hpp).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "medulla/baked.hpp"
#include "tables/bake/fibre_light.hpp"

namespace medulla::tables {

struct BakeOptions {
    int functions = 12;                    ///< exit functions stored: a multiple of 4, up to max_exit_functions
    std::optional<double> max_error;       ///< instead: the fewest whose worst checked error is at most this
    std::optional<std::size_t> max_bytes;  ///< instead: the most within this size
    std::uint64_t seed = 1;
    int sweeps = 80;
    double turn = 0.7;  ///< BakedHeader::turn
};

/// Relative L2 errors of scattered lobes against light of independent paths, whose noise is subtracted.
struct BakeErrors {
    double median = 0, worst = 0;
    double worst_theta_i = 0, worst_h = 0;  ///< where
    std::size_t lobes = 0;                  ///< with enough light to tell
};

struct BakeResult {
    std::vector<unsigned char> pack;
    int functions = 0, sweeps = 0;
    double fit = 0, noise = 0;  ///< relative L2 of the functions at the nodes, and of the simulation's noise there
    BakeErrors errors;
    double seconds = 0;
};

/// @param input name of the file that the light is from, for the provenance
BakeResult bake(const FibreLight& light, const BakeOptions& options, const std::string& input);

/// Bytes of a pack, but for the provenance.
std::size_t baked_bytes(const FibreRequest& request, int functions);

/// Errors of a material at lights and colours that are not among its nodes.
BakeErrors errors_against(const BakedMaterial& material, const std::vector<LightCell>& checks,
                          const std::vector<double>& sigma_ca, std::size_t rows, std::size_t columns);

}  // namespace medulla::tables
