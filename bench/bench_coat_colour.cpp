// How far sigma_ca_of_fur_colour is off: light from a white sky walks through thick coats of the fibres that it
// returns, by the runtime's near fields, and what comes back is compared with the colour that was wanted. Run:
// bench_coat_colour [--error E] [--parallel] [--json]; E: relative standard error of each walk, default 0.004.
// --parallel adds coats of parallel fibres, flat and at 45 degrees to the skin.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>

#include "medulla/colour.hpp"
#include "medulla/medulla.hpp"
#include "tests/support/fibre_of.hpp"

using namespace medulla;

namespace {

struct V3 {
    double x, y, z;
};
V3 operator+(V3 a, V3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V3 operator*(double s, V3 a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(V3 a, V3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V3 cross(V3 a, V3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }

struct Random {
    std::mt19937_64 engine{1};
    double uniform() { return double(engine() >> 11) * 0x1p-53; }
    float single() { return float(engine() >> 40) * 0x1p-24f; }
    V3 direction() {
        const double z = 2 * uniform() - 1, turn = 2 * pi * uniform(), c = std::sqrt((1 - z) * (1 + z));
        return {c * std::cos(turn), c * std::sin(turn), z};
    }
};

enum class Coat { all_directions, flat, slanted };

/// What a fibre along `axis` makes of light that travels along `travel`: turns it, returns the weight.
double scatter(const Fibre<1>& fibre, V3 axis, V3& travel, Random& r) {
    const V3 known = -1.0 * travel;
    const double along = dot(known, axis);
    V3 y = known + (-along) * axis;
    const double across = std::sqrt(dot(y, y));
    if (across < 1e-6) return 1;  // along the fibre: it is not met
    y = (1 / across) * y;
    const V3 z = cross(axis, y);
    const NearField<1> hit = near_field(fibre, Vector{float(along), float(across), 0}, 2 * r.single() - 1);
    const Sample<1> s = hit.sample({r.single(), r.single(), r.single(), r.single()});
    if (!s.valid) return 0;
    travel = double(s.direction.x) * axis + double(s.direction.y) * y + double(s.direction.z) * z;
    travel = (1 / std::sqrt(dot(travel, travel))) * travel;
    return double(s.weight[0]);
}

/// What one ray of a white sky brings back. Free paths are 1 over the width that fibres show the ray.
double walk(const Fibre<1>& fibre, Coat coat, Random& r) {
    const double down = std::sqrt(r.uniform()), turn = 2 * pi * r.uniform(), level = std::sqrt(1 - down * down);
    V3 travel = {level * std::cos(turn), level * std::sin(turn), -down};
    V3 axis = coat == Coat::flat ? V3{1, 0, 0} : V3{std::sqrt(0.5), 0, std::sqrt(0.5)};
    double height = 0, weight = 1;
    for (;;) {
        double width = 1;
        if (coat != Coat::all_directions) {
            const V3 shown = cross(axis, travel);
            width = std::max(1e-6, std::sqrt(dot(shown, shown)));
        }
        height += travel.z * -std::log(1 - r.uniform()) / width;
        if (height > 0) return weight;
        // Fibres in all directions are met in proportion to the width that they show: sin of the angle between.
        if (coat == Coat::all_directions) {
            double u, cosine;
            do {
                axis = r.direction(), u = r.uniform(), cosine = dot(axis, travel);
            } while (u * u > 1 - cosine * cosine);
        }
        weight *= scatter(fibre, axis, travel, r);
        if (weight < 0.1) {
            if (r.uniform() < 0.5) return 0;
            weight *= 2;
        }
    }
}

struct Mean {
    double value, error;
};
Mean coat_albedo(const Fibre<1>& fibre, Coat coat, double relative_error) {
    Random r;
    double sum = 0, squares = 0;
    for (long n = 1;; ++n) {
        const double w = walk(fibre, coat, r);
        sum += w, squares += w * w;
        const double mean = sum / double(n),
                     error = std::sqrt(std::max(0.0, squares / double(n) - mean * mean) / double(n));
        if (n >= 4000 && error < relative_error * mean) return {mean, error};
    }
}

}  // namespace

int main(int argc, char** argv) {
    double relative_error = 0.004;
    bool parallel = false, json = false;
    for (int i = 1; i < argc; ++i) {
        if (std::strcmp(argv[i], "--error") == 0 && i + 1 < argc)
            relative_error = std::atof(argv[++i]);
        else if (std::strcmp(argv[i], "--parallel") == 0)
            parallel = true;
        else if (std::strcmp(argv[i], "--json") == 0)
            json = true;
        else
            return std::fprintf(stderr, "usage: bench_coat_colour [--error E] [--parallel] [--json]\n"), 2;
    }
    if (json)
        std::printf("{\"rows\": [");
    else
        std::printf("%-10s %7s %9s %16s %s\n", "animal", "wanted", "sigma_ca", "coat returns",
                    parallel ? "difference, flat, at 45 degrees" : "difference");
    double worst = 0, squares = 0;
    int rows = 0;
    for (const FurPreset& preset : fur_presets) {
        FurParameters<1> p = parameters_of<1>(preset);
        const test::OwnedTables tables(default_pack(), ranges_of(p));
        for (const float wanted : {0.05f, 0.1f, 0.2f, 0.3f, 0.45f, 0.6f, 0.75f, 0.9f}) {
            const float colour[1] = {wanted};
            const SigmaOfColour<1> answer = sigma_ca_of_fur_colour(p, colour);
            if (answer.status[0] != ColourStatus::ok) {
                if (!json) std::printf("%-10s %7.2f %s\n", preset.name, double(wanted), describe(answer.status[0]));
                continue;
            }
            p.sigma_ca[0] = answer.sigma_ca[0];
            const Fibre<1> fibre = make_fibre(p, tables.get());
            const Mean all = coat_albedo(fibre, Coat::all_directions, relative_error);
            const double difference = all.value / double(wanted) - 1;
            worst = std::max(worst, std::abs(difference)), squares += difference * difference, ++rows;
            if (json) {
                std::printf(
                    "%s\n  {\"animal\": \"%s\", \"wanted\": %g, \"sigma_ca\": %.5g, \"returned\": %.5g, \"error\": "
                    "%.2g",
                    rows == 1 ? "" : ",", preset.name, double(wanted), double(p.sigma_ca[0]), all.value, all.error);
            } else {
                std::printf("%-10s %7.2f %9.4f %8.4f+-%.4f %+.1f %%", preset.name, double(wanted),
                            double(p.sigma_ca[0]), all.value, all.error, 100 * difference);
            }
            if (parallel) {
                const double flat = coat_albedo(fibre, Coat::flat, relative_error).value,
                             slanted = coat_albedo(fibre, Coat::slanted, relative_error).value;
                std::printf(json ? ", \"flat\": %.5g, \"slanted\": %.5g" : ", %+.1f %%, %+.1f %%",
                            json ? flat : 100 * (flat / double(wanted) - 1),
                            json ? slanted : 100 * (slanted / double(wanted) - 1));
            }
            std::printf(json ? "}" : "\n");
            std::fflush(stdout);
        }
    }
    const double typical = std::sqrt(squares / rows);
    std::printf(json ? "],\n \"largest_difference\": %.4g, \"typical_difference\": %.4g, \"walk_error\": %g}\n"
                     : "largest difference %.2g, root mean square %.2g; relative standard error of a walk %g\n",
                worst, typical, relative_error);
    return 0;
}
