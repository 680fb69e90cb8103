#include "tables/job/material.hpp"

#include <cmath>

#include "tables/error.hpp"
#include "tables/store/file.hpp"
#include "tables/store/json_text.hpp"

namespace medulla::tables {
namespace {

using nlohmann::json;

constexpr double radians = pi / 180;
constexpr std::size_t greatest_file = 1 << 20;

std::string read_text(const std::string& path) {
    const std::vector<unsigned char> bytes = read_file(path, greatest_file);
    return {bytes.begin(), bytes.end()};
}

/// A value, shortened for messages.
std::string quoted(const json& value) { return value.dump().substr(0, 40); }

double number(const json& value, const std::string& field) {
    if (!value.is_number()) throw Error("{}: expected a number, found {}", field, quoted(value));
    return value.get<double>();
}

/// One number of a material: its unit in files [radians or 1], and the range of check(FurParameters) in that unit.
struct Field {
    const char* name;
    float FurParameters<3>::*value;
    double unit;
    const char* range;
};
constexpr Field fields[] = {{"eta", &FurParameters<3>::eta, 1, "a value in (1, 10]"},
                            {"kappa", &FurParameters<3>::kappa, 1, "a value in [0, 1]"},
                            {"alpha", &FurParameters<3>::alpha, radians, "degrees in [-90, 90]"},
                            {"beta_m", &FurParameters<3>::beta_m, radians, "degrees in [0.00573, 229.18]"},
                            {"beta_n", &FurParameters<3>::beta_n, radians, "degrees in [0.00573, 229.18]"},
                            {"layers", &FurParameters<3>::layers, 1, "a value in [0, 1000]"},
                            {"sigma_ms", &FurParameters<3>::sigma_ms, 1, "a value in [0, 1e9]"},
                            {"sigma_ma", &FurParameters<3>::sigma_ma, 1, "a value in [0, 1e9]"},
                            {"g", &FurParameters<3>::g, 1, "a value in (-1, 1)"}};

/// Whether check() refuses the default fibre with this one field of `fur`.
bool refused(const FurParameters<3>& fur, const Field& field) {
    FurParameters<3> alone;
    alone.*field.value = fur.*field.value;
    return out_of_range(alone) != 0;
}

/// @param pointer JSON pointer of the entry in its file, empty for the whole file
Material material_of(const json& entry, const std::string& path, const std::string& pointer) {
    const std::string inside = path + ": " + pointer;
    if (!entry.is_object())
        throw Error("{}: expected an object, found {}", pointer.empty() ? path : inside, quoted(entry));
    Material material;
    if (entry.contains("preset")) {
        const json& preset = entry["preset"];
        if (!preset.is_string()) throw Error("{}/preset: expected a name, found {}", inside, quoted(preset));
        material = preset_material(preset.get<std::string>(), inside + "/preset");
    }
    FurParameters<3>& fur = material.fur;
    for (const auto& [key, value] : entry.items()) {
        const std::string field = inside + "/" + key;
        if (key == "preset") continue;
        if (key == "name") {
            if (!value.is_string()) throw Error("{}: expected a name, found {}", field, quoted(value));
            material.name = value.get<std::string>();
            continue;
        }
        if (key == "fresnel") {
            if (value != "bravais" && value != "exact")
                throw Error("{}: expected \"bravais\" or \"exact\", found {}", field, quoted(value));
            fur.fresnel = value == "exact" ? Fresnel::exact : Fresnel::bravais;
            continue;
        }
        if (key == "scattering") {
            if (value != "published" && value != "corrected")
                throw Error("{}: expected \"published\" or \"corrected\", found {}", field, quoted(value));
            fur.scattering = value == "corrected" ? Scattering::corrected : Scattering::published;
            continue;
        }
        if (key == "sigma_ca") {
            material.grey = !value.is_array();
            if (value.is_array() && value.size() != 3)
                throw Error("{}: expected one number or three, found {}", field, value.size());
            for (std::size_t c = 0; c < 3; ++c) {
                const double x = number(value.is_array() ? value[c] : value, field);
                fur.sigma_ca[c] = static_cast<float>(x);
                FurParameters<3> alone;
                alone.sigma_ca[c] = fur.sigma_ca[c];
                if (out_of_range(alone) != 0) throw Error("{}: expected values in [0, 1e9], found {:g}", field, x);
            }
            continue;
        }
        bool known = false;
        for (const Field& f : fields) {
            if (key != f.name) continue;
            known = true;
            const double x = number(value, field);
            fur.*f.value = static_cast<float>(x * f.unit);
            if (refused(fur, f)) throw Error("{}: expected {}, found {:g}", field, f.range, x);
        }
        if (!known)
            throw Error(
                "{}: no such field; expected name, preset, eta, kappa, alpha, beta_m, beta_n, layers, sigma_ca, "
                "sigma_ms, sigma_ma, g, fresnel or scattering",
                field);
    }
    return material;
}

}  // namespace

Material preset_material(const std::string& name, const std::string& where) {
    if (const FurPreset* preset = find_preset(name.c_str())) return {name, parameters_of<3>(*preset), true};
    std::string names;
    for (const FurPreset& preset : fur_presets) names += std::string(names.empty() ? "" : ", ") + preset.name;
    throw Error("{}: expected one of {}, each also with _corrected; found '{}'", where, names, name);
}

Material read_material(const std::string& path) { return parse_material(read_text(path), path); }

std::vector<Material> read_scene(const std::string& path) { return parse_scene(read_text(path), path); }

Material parse_material(const std::string& text, const std::string& where) {
    return material_of(parse_json(text.data(), text.data() + text.size(), where), where, "");
}

std::vector<Material> parse_scene(const std::string& text, const std::string& path) {
    const json scene = parse_json(text.data(), text.data() + text.size(), path);
    const json list = scene.is_object() && scene.contains("materials") ? scene["materials"] : json();
    if (!list.is_array() || list.empty())
        throw Error("{}: /materials: expected a list of materials, found {}", path,
                    list.is_null() ? "none" : quoted(list));
    std::vector<Material> materials;
    for (std::size_t i = 0; i < list.size(); ++i)
        materials.push_back(material_of(list[i], path, fmt::format("/materials/{}", i)));
    return materials;
}

}  // namespace medulla::tables
