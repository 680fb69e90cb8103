// The numbers of --error-map as JSON: docs/truth.md.
#include "tables/programs/error_map.hpp"
#include "tables/store/json_text.hpp"

namespace medulla::tables {
namespace {

using nlohmann::ordered_json;

constexpr double degrees = 180 / pi;

ordered_json json_of(const sim3d::Estimate& e) { return {e.value, e.error}; }
ordered_json json_of(const sim3d::Distance& d) {
    if (!d.defined) return nullptr;
    return {{"value", d.value()}, {"error", d.error()}, {"square", json_of(d.square)}};
}
ordered_json json_of(const sim3d::ChannelError& e);
ordered_json json_of(const sim3d::Causes& c);
ordered_json json_of(const sim3d::LightError& e);
template <class List>
ordered_json list_of(const List& list) {
    ordered_json out = ordered_json::array();
    for (const auto& x : list) out.push_back(json_of(x));
    return out;
}

ordered_json json_of(const sim3d::ChannelError& e) {
    ordered_json out;
    for (std::size_t k = 0; k < sim3d::class_count; ++k) out["truth"][sim3d::class_names[k]] = json_of(e.truth[k]);
    out["truth"]["scattered"] = json_of(e.scattered);
    for (std::size_t k = 0; k < all_lobe_count; ++k) out["model"][lobe_names[k]] = e.model[k];
    out["model"]["scattered"] = e.model_scattered();
    out["lobe"] = json_of(e.lobe), out["shape"] = json_of(e.shape), out["shape_with_cosine"] = json_of(e.cosine);
    out["sigma"] = json_of(e.sigma);
    return out;
}

ordered_json json_of(const sim3d::LightError& e) {
    return {
        {"theta_i", e.theta_i * degrees}, {"h", {e.offsets.low, e.offsets.high}}, {"channels", list_of(e.channels)}};
}

ordered_json json_of(const sim3d::Causes& c) {
    ordered_json out;
    const char* variants[] = {"published", "authors", "cosine", "authors_cosine"};
    for (std::size_t near : {0u, 1u}) {
        ordered_json shape;
        for (std::size_t v = 0; v < sim3d::longitudinal_count; ++v) shape[variants[v]] = json_of(c.shape[near][v]);
        shape["over_phi"] = json_of(c.over_phi[near]), shape["over_theta_r"] = json_of(c.over_theta[near]);
        shape["product"] = json_of(c.product[near]);
        shape["sigma"] = json_of(c.sigma[near]), shape["sigma_over_theta_r"] = json_of(c.sigma_over_theta[near]);
        if (near == 0) shape["smooth_cuticle"] = json_of(c.cuticle);
        out[near ? "shape_of_offsets" : "shape_of_far_field"] = shape;
    }
    out["energy"] = {{"scattered", json_of(c.entering)}, {"absorbed", json_of(c.absorbing)}};
    out["cortex_length"] = {{"truth", json_of(c.cortex_length)}, {"model", c.model_cortex_length}};
    out["medulla_length"] = {{"truth", json_of(c.medulla_length)}, {"model", c.model_medulla_length}};
    out["R_smooth"] = c.R_smooth;
    return out;
}

}  // namespace

std::string ErrorMapTitle::channel(std::size_t c) const {
    constexpr const char* names[] = {"red", "green", "blue"};
    return material.grey ? "grey" : names[c];
}

ordered_json error_map_json(const ErrorMapTitle& title, const sim3d::ErrorMap& map) {
    const FurParameters<3>& p = title.material.fur;
    ordered_json json;
    json["name"] = json_name(title.material.name);
    json["material"] = {{"kappa", p.kappa},
                        {"eta", p.eta},
                        {"alpha", double(p.alpha) * degrees},
                        {"beta_m", double(p.beta_m) * degrees},
                        {"beta_n", double(p.beta_n) * degrees},
                        {"layers", p.layers},
                        {"sigma_ms", p.sigma_ms},
                        {"sigma_ma", p.sigma_ma},
                        {"g", p.g},
                        {"fresnel", p.fresnel == Fresnel::exact ? "exact" : "bravais"},
                        {"scattering", p.scattering == Scattering::corrected ? "corrected" : "published"}};
    for (std::size_t c = 0; c < title.channels(); ++c) {
        json["material"]["sigma_ca"].push_back(p.sigma_ca[c]);
        json["channels"].push_back(title.channel(c));
    }
    json["paths_per_cell"] = title.paths, json["seed"] = title.seed, json["paths"] = map.paths;
    json["lost"] = json_of(map.lost);
    json["all_directions"] = list_of(map.all.channels);
    json["causes"] = list_of(map.causes);
    json["far_field"] = list_of(map.far);
    json["cells"] = list_of(map.cells);
    return json;
}

}  // namespace medulla::tables
