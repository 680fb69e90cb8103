// What every adapter must pass, in world space and in double: a white fibre returns all light, a lobe that is tilted by
// alpha = 5 degrees and lit from one side leaves where a cylinder's scales send it, and samples follow the values.
#pragma once

#include <catch2/catch.hpp>
#include <cmath>
#include <memory>
#include <random>

#include "medulla/medulla.hpp"

namespace adapters {

struct V3 {
    double x, y, z;
};
inline V3 operator+(V3 a, V3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline V3 operator-(V3 a, V3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline V3 operator*(double s, V3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(V3 a, V3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline V3 cross(V3 a, V3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline V3 unit(V3 a) { return 1 / std::sqrt(dot(a, a)) * a; }

/// A ray that meets a cylinder of radius 1, as geometry alone has it.
struct Hit {
    V3 tangent, travel;  ///< unit: root to tip; of the ray
    V3 across;           ///< unit: travel in the cross-section
    V3 normal;           ///< unit, outwards; the point that was met, from the axis

    /// @param left distance of the ray from the axis, to the left of its travel
    Hit(V3 tangent_, V3 travel_, double left) : tangent(unit(tangent_)), travel(unit(travel_)) {
        across = unit(travel - dot(travel, tangent) * tangent);
        normal = left * cross(tangent, across) - std::sqrt(1 - left * left) * across;
    }
    V3 known() const { return -1.0 * travel; }
};

/// What multiplies the light of a direction per steradian, the renderer's cosines included, and the pdf.
struct Exit {
    double value = 0, pdf = 0;
};

/// A direction by its inclination towards the tip and its azimuth's unit vector.
inline V3 direction(const Hit& hit, double towards_tip, V3 azimuth) {
    return std::sin(towards_tip) * hit.tangent + std::cos(towards_tip) * azimuth;
}

template <class F>
void over_sphere(const Hit& hit, F&& f) {
    constexpr int rows = 120, columns = 240;
    const V3 side = cross(hit.tangent, hit.across);
    for (int i = 0; i < rows; ++i)
        for (int j = 0; j < columns; ++j) {
            const double theta = ((i + 0.5) / rows - 0.5) * medulla::pi, phi = 2 * medulla::pi * (j + 0.5) / columns;
            const V3 w = direction(hit, theta, std::cos(phi) * hit.across + std::sin(phi) * side);
            f(w, std::cos(theta) * medulla::pi / rows * 2 * medulla::pi / columns);
        }
}

/// Hits of several frames, both sides and both slants.
inline const Hit hits[] = {{{1, 0, 0}, {0, 0, -1}, 0.5},
                           {{0, 0.3, 1}, {0.5, -0.8, 0.1}, -0.5},
                           {{0.2, -1, 0.4}, {-1, -0.3, 0.2}, 0.7},
                           {{-0.5, 0.5, 0.7}, {0.2, 1, 0.4}, -0.2}};

/// @param make parameters to an adapter, whose evaluate(hit, drawn) gives an Exit and whose sample(hit, u, drawn) an
///        Exit too, with pdf 0 where there is none
template <class Make>
void check(Make&& make) {
    using namespace medulla;
    FurParameters<3> white = parameters_of<3>(*find_preset("dog"));
    for (float& s : white.sigma_ca) s = 0;
    const auto furnace = make(white);
    std::mt19937 engine(3);
    std::uniform_real_distribution<float> uniform(0, 1);
    for (const Hit& hit : hits) {
        double energy = 0, pdf = 0;
        V3 mean = {0, 0, 0};
        over_sphere(hit, [&](V3 w, double weight) {
            const Exit e = furnace.evaluate(hit, w);
            energy += weight * e.value, pdf += weight * e.pdf, mean = mean + weight * e.value * w;
        });
        CHECK(energy == Approx(1).margin(2e-3));  // midpoints of 1.5 degrees
        CHECK(pdf == Approx(1).margin(2e-3));
        constexpr int samples = 20000;
        V3 drawn_mean = {0, 0, 0};
        double drawn_energy = 0;
        for (int i = 0; i < samples; ++i) {
            const float u[5] = {uniform(engine), uniform(engine), uniform(engine), uniform(engine), uniform(engine)};
            V3 w;
            const Exit s = furnace.sample(hit, u, w);
            REQUIRE(s.pdf > 0);
            if (i < 100) {
                const Exit e = furnace.evaluate(hit, w);
                REQUIRE(e.pdf == Approx(s.pdf).epsilon(2e-3));
                REQUIRE(e.value == Approx(s.value).epsilon(2e-3));
            }
            drawn_energy += s.value / s.pdf / samples;
            drawn_mean = drawn_mean + s.value / s.pdf / samples * w;
        }
        // Components of a unit vector deviate by at most 1: 4 sigma of 20000, and the midpoints.
        CHECK(drawn_energy == Approx(1).margin(5e-3));
        CHECK(drawn_mean.x == Approx(mean.x).margin(0.03));
        CHECK(drawn_mean.y == Approx(mean.y).margin(0.03));
        CHECK(drawn_mean.z == Approx(mean.z).margin(0.03));
    }

    FurParameters<3> mirror;  // R alone
    mirror.kappa = 0, mirror.alpha = float(5 * pi / 180), mirror.beta_m = 0.03f, mirror.beta_n = 0.03f;
    for (float& s : mirror.sigma_ca) s = 64;
    const auto lit = make(mirror);
    const double alpha = double(mirror.alpha);
    for (const Hit& hit : hits) {
        const double known = std::asin(dot(hit.known(), hit.tangent));  // towards the tip
        const V3 reflected = hit.across - 2 * dot(hit.across, hit.normal) * hit.normal;
        const V3 other_side = 2 * dot(reflected, hit.across) * hit.across - reflected;
        const double there = lit.evaluate(hit, direction(hit, -known - alpha, reflected)).value;
        // The scales' outer faces look to the root, alpha of Table 2 beyond the mirror direction.
        CHECK(there > 0);
        CHECK(there > 20 * lit.evaluate(hit, direction(hit, -known + alpha, reflected)).value);
        CHECK(there > 20 * lit.evaluate(hit, direction(hit, -known - alpha, other_side)).value);
        for (const double turn : {-0.02, 0.02}) {
            const V3 turned = std::cos(turn) * reflected + std::sin(turn) * cross(hit.tangent, reflected);
            CHECK(there > lit.evaluate(hit, direction(hit, -known - alpha, turned)).value);
            CHECK(there > lit.evaluate(hit, direction(hit, -known - alpha + turn, reflected)).value);
        }
    }
}

/// Tables of a material in memory of their own.
class OwnedTables {
  public:
    explicit OwnedTables(const medulla::FurParameters<3>& p) {
        const medulla::TableRanges ranges = medulla::ranges_of(p);
        std::size_t bytes = medulla::tables_bytes(medulla::default_pack(), ranges), room = bytes + 64;
        memory_.reset(new char[room]);
        void* aligned = memory_.get();
        std::align(64, bytes, aligned, room);
        tables_ = medulla::make_tables(medulla::default_pack(), ranges, aligned, bytes).tables;
    }
    const medulla::DenseTables* get() const { return tables_; }

  private:
    std::unique_ptr<char[]> memory_;
    const medulla::DenseTables* tables_ = nullptr;
};

}  // namespace adapters
