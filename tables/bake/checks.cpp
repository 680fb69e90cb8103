// How far a baked material is from light of independent paths.
#include <algorithm>
#include <cmath>

#include "medulla/baked_field.hpp"
#include "tables/bake/bake.hpp"

namespace medulla::tables {
namespace {

/// Mean of the scattered density over each bin: nine points of a bin, as it is bilinear between nodes half a bin away.
std::vector<double> bin_averages(const BakedNear<1>& hit, std::size_t rows, std::size_t columns) {
    constexpr int points = 3;
    std::vector<double> averages;
    const auto at = [](std::size_t i, int k, std::size_t n) {
        return (static_cast<double>(i) + (k + 0.5) / points) / static_cast<double>(n) - 0.5;
    };
    for (std::size_t r = 0; r < rows; ++r)
        for (std::size_t c = 0; c < columns; ++c) {
            double sum = 0;
            for (int i = 0; i < points; ++i)
                for (int j = 0; j < points; ++j)
                    sum += static_cast<double>(hit.scattered_density(
                        static_cast<float>(pi * at(r, i, rows)), static_cast<float>(2 * pi * at(c, j, columns)))[0]);
            averages.push_back(sum / (points * points));
        }
    return averages;
}

}  // namespace

BakeErrors errors_against(const BakedMaterial& material, const std::vector<LightCell>& checks,
                          const std::vector<double>& sigma_ca, std::size_t rows, std::size_t columns) {
    BakeErrors result;
    std::vector<double> each;
    for (const LightCell& cell : checks)
        for (std::size_t c = 0; c < sigma_ca.size(); ++c) {
            const float sigma[1] = {static_cast<float>(sigma_ca[c])};
            const BakedFibre<1> fibre = make_fibre(material, sigma);
            const BakedNear<1> hit =
                near_field(fibre, Angles{static_cast<float>(cell.theta_i), 0}, static_cast<float>(cell.h));
            const std::vector<double> baked = bin_averages(hit, rows, columns);
            double difference = 0, noise = 0, norm = 0;
            for (std::size_t b = 0; b < baked.size(); ++b) {
                const double truth = static_cast<double>(cell.density[c * baked.size() + b]);
                const double error = static_cast<double>(cell.error[c * baked.size() + b]);
                difference += (baked[b] - truth) * (baked[b] - truth), noise += error * error, norm += truth * truth;
            }
            if (!(norm > 100 * noise)) continue;  // too little light, or too few paths, to tell
            const double error = std::sqrt(std::max(0.0, difference - noise) / (norm - noise));
            each.push_back(error);
            if (error >= result.worst)
                result.worst = error, result.worst_theta_i = cell.theta_i, result.worst_h = cell.h;
        }
    result.lobes = each.size();
    if (each.empty()) {
        result.median = result.worst = 1;  // nothing is claimed
        return result;
    }
    std::sort(each.begin(), each.end());
    result.median = each[each.size() / 2];
    return result;
}

}  // namespace medulla::tables
