// furtable bcsdf and furtable presets: the fur model by hand, lobe by lobe.
#include <fmt/format.h>

#include "medulla/medulla.hpp"
#include "tables/job/material.hpp"
#include "tables/programs/commands.hpp"
#include "tables/programs/number.hpp"
#include "tables/store/json_text.hpp"

namespace medulla::tables {
namespace {

struct BcsdfWords {
    std::string preset, material, range, pack = "default";
    double theta_i = 0, theta_r = 0, phi = 0, h = 0;
    bool far = false, json = false;
    const CLI::Option* h_given = nullptr;
};

OffsetRange range_of(const BcsdfWords& words) {
    if (words.far) return {-1, 1};
    if (*words.h_given) {
        if (!(words.h >= -1 && words.h <= 1)) throw UsageError("--h: expected a value in [-1, 1], found {:g}", words.h);
        return {static_cast<float>(words.h), static_cast<float>(words.h)};
    }
    const std::size_t colon = std::min(words.range.find(':'), words.range.size() - 1);
    const auto low = parse_number<double>(words.range.substr(0, colon)),
               high = parse_number<double>(words.range.substr(colon + 1));
    if (!low || !high || !(-1 <= *low && *low <= *high && *high <= 1))
        throw UsageError("--h-range: expected A:B with -1 <= A <= B <= 1, found '{}'", words.range);
    return {static_cast<float>(*low), static_cast<float>(*high)};
}

/// One number for grey fur, three for coloured.
nlohmann::ordered_json colour(const double (&value)[3], bool grey) {
    if (grey) return value[0];
    return {value[0], value[1], value[2]};
}

/// Says where the pack's axes end before what the fibre asks of them: there the runtime holds to the end.
void warn_beyond_axes(const FurFibre<3>& fibre, const Longitudinal<3>& at, double offset, const Source& pack,
                      const std::string& path) {
    if (!fibre.scattered) return;
    Parameters asked;
    asked.sigma = static_cast<double>(at.sigma), asked.g = static_cast<double>(fibre.parameters.g);
    asked.theta_i = std::abs(static_cast<double>(at.theta_i));
    asked.h = offset * static_cast<double>(at.at.inverse_index) / static_cast<double>(fibre.parameters.kappa);
    asked.h = std::min(asked.h, 1.0);  // beyond, light passes the medulla by
    if (pack.absorbs()) asked.absorption = static_cast<double>(at.absorbed);
    std::string beyond;
    for (const TableKind kind : lobe_kinds) {
        const std::string one = pack.beyond(kind, asked);
        if (beyond.find(one) == std::string::npos) beyond += (beyond.empty() ? "" : "; ") + one;
    }
    if (!beyond.empty())
        say("furtable", fmt::format("warning: {}: {}: TTs and TRTs are those of the axis's end", path, beyond));
}

void run_bcsdf(const BcsdfWords& words) {
    const auto check = [](const char* name, double degrees, const char* range) {
        if (!(degrees >= -90 && degrees <= 90))
            throw UsageError("{}: expected degrees in {}, found {}", name, range, degrees);
    };
    check("--theta-i", words.theta_i, "(-90, 90)"), check("--theta-r", words.theta_r, "[-90, 90]");
    const double phi = std::remainder(words.phi, 360.0);
    const OffsetRange range = range_of(words);
    Material material;
    if (words.material.empty()) {
        try {
            material = preset_material(words.preset, "--preset");
        } catch (const Error& error) {
            throw UsageError("{}", error.what());
        }
    } else {
        material = read_material(words.material);
    }
    const std::vector<unsigned char> bytes = read_pack(words.pack);
    const PackView pack = open_pack(bytes.data(), bytes.size()).pack;
    FurFibre<3> fibre;
    if (const FurStatus status = prepare(material.fur, pack, fibre); status != FurStatus::ok)
        throw Error("{}: {}", words.pack, describe(status));

    const double radians = pi / 180, theta_i = words.theta_i * radians;
    FarField<3> field;
    far_field(fibre, static_cast<float>(theta_i), range, field);
    if (!field.valid)
        throw UsageError(
            "--theta-i: expected degrees within (-90, 90), since light along the fibre meets no section, found {}",
            words.theta_i);
    warn_beyond_axes(fibre, field.near.longitudinal,
                     static_cast<double>(std::max(std::abs(range.low), std::abs(range.high))),
                     *pack_source(bytes, words.pack), words.pack);
    const LobeValues<3> lobes =
        field.lobes(static_cast<float>(words.theta_r * radians), static_cast<float>(phi * radians));
    const double cosine = std::cos(theta_i);
    nlohmann::ordered_json json;
    double sum[3] = {};
    if (!words.json)
        print("{:<5} {:>12}  {:>12}  {:>12}\n", "lobe", "M [1/rad]", "N [1/rad]", "M N / cos^2 theta_i [1/rad^2]");
    for (int lobe = 0; lobe < lobe_count; ++lobe) {
        double N[3], value[3];
        for (int c = 0; c < 3; ++c) {
            N[c] = static_cast<double>(lobes.N[lobe][c]);
            value[c] = static_cast<double>(lobes.M[lobe]) * N[c] / (cosine * cosine);
            sum[c] += value[c];
        }
        json["lobes"][lobe_names[lobe]] = {
            {"M", lobes.M[lobe]}, {"N", colour(N, material.grey)}, {"value", colour(value, material.grey)}};
        for (int c = 0; c < (material.grey ? 1 : 3) && !words.json; ++c)
            print("{:<5} {:>12.6g}  {:>12.6g}  {:>12.6g}\n", c == 0 ? lobe_names[lobe] : "",
                  static_cast<double>(lobes.M[lobe]), N[c], value[c]);
    }
    json["sum"] = colour(sum, material.grey);
    if (words.json)
        print("{}\n", json_line(json));
    else
        print_text(fmt::format("sum   {:.6g}\n", fmt::join(sum, sum + (material.grey ? 1 : 3), "  ")));
}

struct PresetWords {
    bool json = false;
};

/// The number that is printed: 0.88 rather than the float next to it.
double as_printed(float x) { return std::stod(fmt::format("{}", x)); }

void run_presets(const PresetWords& words) {
    nlohmann::ordered_json json = nlohmann::ordered_json::array();
    constexpr const char* line = "{:<10} {:>6} {:>6} {:>6} {:>7} {:>7} {:>8} {:>8} {:>8} {:>5} {:>6}\n";
    if (!words.json) {
        print(line, "name", "kappa", "eta", "alpha", "beta_m", "beta_n", "sigma_ca", "sigma_ms", "sigma_ma", "g",
              "layers");
        // Sigmas are per fibre radius.
        print(line, "", "", "", "deg", "deg", "deg", "1/r", "1/r", "1/r", "", "");
    }
    for (const FurPreset& p : fur_presets) {
        json.push_back({{"name", p.name},
                        {"kappa", as_printed(p.kappa)},
                        {"eta", as_printed(p.eta)},
                        {"alpha", as_printed(p.alpha)},
                        {"beta_m", as_printed(p.beta_m)},
                        {"beta_n", as_printed(p.beta_n)},
                        {"sigma_ca", as_printed(p.sigma_ca)},
                        {"sigma_ms", as_printed(p.sigma_ms)},
                        {"sigma_ma", as_printed(p.sigma_ma)},
                        {"g", as_printed(p.g)},
                        {"layers", as_printed(p.layers)}});
        if (!words.json)
            print(line, p.name, p.kappa, p.eta, p.alpha, p.beta_m, p.beta_n, p.sigma_ca, p.sigma_ms, p.sigma_ma, p.g,
                  p.layers);
    }
    if (words.json) print("{}\n", json_line(nlohmann::ordered_json{{"presets", json}}));
}

}  // namespace

void add_bcsdf(CLI::App& app, Action& action) {
    add_command<BcsdfWords>(
        app, action, "bcsdf", "the fur model lobe by lobe: M, N, M N / cos^2 theta_i",
        [](CLI::App& command, BcsdfWords& words) {
            auto* which = command.add_option_group("material")->require_option(1);
            which->add_option("--preset", words.preset, "animal of Table 4 (furtable presets)");
            which->add_option("--material", words.material, "JSON file of one material");
            add_number(command, "--theta-i", words.theta_i, "inclination of the light, degrees in (-90, 90)")
                ->required();
            add_number(command, "--theta-r", words.theta_r, "inclination of exit, degrees in [-90, 90]")->required();
            add_number(command, "--phi", words.phi,
                       "azimuth of exit less that of the light, degrees; 0 = back, whole turns count for nothing")
                ->required();
            auto* where = command.add_option_group("offset")->require_option(1);
            words.h_given = add_number(*where, "--h", words.h, "near field: one offset in [-1, 1]");
            where->add_option("--h-range", words.range, "mean over offsets A:B");
            where->add_flag("--far", words.far, "far field: mean over -1:1");
            command
                .add_option("--pack", words.pack,
                            "tables of the scattered lobes; beyond its axes their ends hold, and a warning says so")
                ->capture_default_str();
            command.add_flag("--json", words.json, "print one JSON object");
        },
        run_bcsdf);
}

void add_presets(CLI::App& app, Action& action) {
    add_command<PresetWords>(
        app, action, "presets", "the animals of Table 4 (angles in degrees, sigma per fibre radius)",
        [](CLI::App& command, PresetWords& words) { command.add_flag("--json", words.json, "print one JSON object"); },
        run_presets);
}

}  // namespace medulla::tables
