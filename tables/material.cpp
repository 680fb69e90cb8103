#include "tables/material.hpp"

#include <cmath>

#include "tables/error.hpp"
#include "tables/file.hpp"
#include "tables/json_text.hpp"

namespace medulla::tables {
namespace {

using nlohmann::json;

constexpr double radians = pi / 180;
constexpr std::size_t greatest_file = 1 << 20;

std::string read_text(const std::string& path) {
    const std::vector<unsigned char> bytes = read_file(path, greatest_file);
    return {bytes.begin(), bytes.end()};
}

double number(const json& value, const std::string& field) {
    if (!value.is_number()) throw Error("{}: expected a number, found {}", field, value.dump().substr(0, 40));
    return value.get<double>();
}

Material material_of(const json& entry, const std::string& where) {
    if (!entry.is_object()) throw Error("{}: expected an object, found {}", where, entry.dump().substr(0, 40));
    Material material;
    if (entry.contains("preset")) {
        if (!entry["preset"].is_string()) throw Error("{}/preset: expected a name", where);
        material = preset_material(entry["preset"].get<std::string>(), where + "/preset");
    }
    FurParameters<3>& fur = material.fur;
    const struct {
        const char* name;
        float* value;
        double unit;
    } fields[] = {{"eta", &fur.eta, 1},
                  {"kappa", &fur.kappa, 1},
                  {"alpha", &fur.alpha, radians},
                  {"beta_m", &fur.beta_m, radians},
                  {"beta_n", &fur.beta_n, radians},
                  {"layers", &fur.layers, 1},
                  {"sigma_ms", &fur.sigma_ms, 1},
                  {"sigma_ma", &fur.sigma_ma, 1},
                  {"g", &fur.g, 1}};
    for (const auto& [key, value] : entry.items()) {
        const std::string field = where + "/" + key;
        if (key == "preset") continue;
        if (key == "name") {
            if (!value.is_string()) throw Error("{}: expected a name", field);
            material.name = value.get<std::string>();
            continue;
        }
        if (key == "fresnel") {
            if (value != "bravais" && value != "exact")
                throw Error("{}: expected \"bravais\" or \"exact\", found {}", field, value.dump());
            fur.fresnel = value == "exact" ? Fresnel::exact : Fresnel::bravais;
            continue;
        }
        if (key == "sigma_ca") {
            material.grey = !value.is_array();
            if (value.is_array() && value.size() != 3)
                throw Error("{}: expected one number or three, found {}", field, value.size());
            for (std::size_t c = 0; c < 3; ++c)
                fur.sigma_ca[c] = static_cast<float>(number(value.is_array() ? value[c] : value, field));
            continue;
        }
        bool known = false;
        for (const auto& f : fields)
            if (key == f.name) *f.value = static_cast<float>(number(value, field) * f.unit), known = true;
        if (!known)
            throw Error(
                "{}: no such field; expected name, preset, eta, kappa, alpha, beta_m, beta_n, layers, sigma_ca, "
                "sigma_ms, sigma_ma, g or fresnel",
                field);
    }
    if (const FurStatus status = check(fur); status != FurStatus::ok) throw Error("{}: {}", where, describe(status));
    return material;
}

}  // namespace

Material preset_material(const std::string& name, const std::string& where) {
    if (const FurPreset* preset = find_preset(name.c_str())) return {name, parameters_of<3>(*preset), true};
    std::string names;
    for (const FurPreset& preset : fur_presets) names += std::string(names.empty() ? "" : ", ") + preset.name;
    throw Error("{}: expected one of {}; found '{}'", where, names, name);
}

Material read_material(const std::string& path) { return parse_material(read_text(path), path); }

std::vector<Material> read_scene(const std::string& path) { return parse_scene(read_text(path), path); }

Material parse_material(const std::string& text, const std::string& where) {
    return material_of(parse_json(text.data(), text.data() + text.size(), where), where + ": ");
}

std::vector<Material> parse_scene(const std::string& text, const std::string& path) {
    const json scene = parse_json(text.data(), text.data() + text.size(), path);
    if (!scene.is_object() || !scene.contains("materials") || !scene["materials"].is_array() ||
        scene["materials"].empty())
        throw Error("{}: /materials: expected a list of materials", path);
    std::vector<Material> materials;
    for (std::size_t i = 0; i < scene["materials"].size(); ++i)
        materials.push_back(material_of(scene["materials"][i], fmt::format("{}: /materials/{}", path, i)));
    return materials;
}

}  // namespace medulla::tables
