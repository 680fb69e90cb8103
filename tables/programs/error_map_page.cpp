// The page of --error-map: tables, maps and pictures in one HTML file without scripts.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "plot/figure.hpp"
#include "tables/programs/error_map.hpp"
#include "tables/programs/error_map_picture.hpp"
#include "tables/programs/error_map_style.hpp"

namespace medulla::tables {
namespace {

using sim3d::ChannelError;
using sim3d::Distance;
using sim3d::Estimate;

constexpr double degrees = 180 / pi;

std::string escaped(const std::string& text) {
    std::string out;
    for (const char c : plot::printable(text)) {
        if (c == '&')
            out += "&amp;";
        else if (c == '<')
            out += "&lt;";
        else
            out += c;
    }
    return out;
}

std::string signed_text(double x, int digits = 4) {
    const std::string text = fmt::format("{:.{}f}", std::abs(x), digits);
    const bool zero = text.find_first_not_of("0.") == std::string::npos;
    return zero ? text : (x < 0 ? "−" : "+") + text;
}

/// "± 0.0003": an error, rounded to its one significant digit.
std::string noise(double error) {
    if (error == 0) return "no noise";
    if (error < 1e-5) return "± &lt; 0.00001";
    const int digits = std::clamp(static_cast<int>(std::ceil(-std::log10(error) - 0.022)), 1, 9);  // 0.95 is 1
    return fmt::format("± {:.{}f}", error, digits);
}

std::string distance_cell(const Distance& d) {
    if (!d.defined) return "<td class=\"quiet\">no light</td>";
    if (!d.resolved()) return fmt::format("<td class=\"quiet\">&lt; {:.3f} <small>noise</small></td>", d.bound());
    return fmt::format("<td>{:.3f} <small>{}</small></td>", d.value(), noise(d.error()));
}

/// Model - truth, and whether it is more than the noise.
std::string difference_cells(double model, const Estimate& truth) {
    const double d = model - truth.value;
    const bool beyond = std::abs(d) > 2 * truth.error;
    return fmt::format("<td{}>{}</td><td>{}</td>", beyond ? "" : " class=\"quiet\"", signed_text(d),
                       !beyond ? std::string("<span class=\"quiet\">within noise</span>")
                               : (truth.value > 0 && std::abs(d) >= 5e-5 ? signed_text(100 * d / truth.value, 1) + " %"
                                                                         : std::string("–")));
}

std::string energy_row(const std::string& name, const Estimate& truth, const double* model, const char* kind = "") {
    return fmt::format("<tr class=\"{}\"><td>{}</td><td>{:.4f} <small>{}</small></td>{}</tr>", kind, name, truth.value,
                       noise(truth.error),
                       model ? fmt::format("<td>{:.4f}</td>{}", *model, difference_cells(*model, truth))
                             : std::string("<td>–</td><td>–</td><td></td>"));
}

Estimate sum(std::initializer_list<Estimate> parts) {
    Estimate s;
    for (const Estimate& e : parts) s.value += e.value, s.error = std::hypot(s.error, e.error);
    return s;
}

std::string energy_table(const ChannelError& e) {
    const double none = 0, scattered = e.model_scattered(), TTs = e.model[3], TRTs = e.model[4];
    const double total = e.model[0] + e.model[1] + e.model[2] + scattered;
    std::string rows = energy_row("R", e.truth[0], &e.model[0]) + energy_row("TT", e.truth[1], &e.model[1]) +
                       energy_row("TRT", e.truth[2], &e.model[2]) + energy_row("TRRT and higher", e.truth[3], &none) +
                       energy_row("scattered", e.scattered, &scattered) +
                       energy_row("never reflected inside (TTs)", e.truth[4], &TTs, "part") +
                       energy_row("reflected inside before a collision (TRTs)", e.truth[5], &TRTs, "part") +
                       energy_row("reflected inside after one (no lobe)", e.truth[6], &none, "part") +
                       energy_row("all light that leaves",
                                  sum({e.truth[0], e.truth[1], e.truth[2], e.truth[3], e.scattered}), &total, "sum");
    return "<div class=\"wrap\"><table><thead><tr><th></th><th>truth</th><th>model</th><th>model − truth</th><th>of "
           "truth</th></tr></thead><tbody>" +
           rows + "</tbody></table></div>";
}

/// The name of a row, with its meaning below.
std::string explained(const std::string& name, const std::string& why) {
    return why.empty() ? name : name + "<span class=\"why\">" + why + "</span>";
}

std::string shape_row(const std::string& name, const Distance& far, const Distance* near, const std::string& why) {
    return fmt::format("<tr><td>{}</td>{}{}</tr>", explained(name, why), distance_cell(far),
                       near ? distance_cell(*near) : std::string("<td class=\"quiet\">–</td>"));
}

/// Which of two squared errors is smaller, in words.
std::string nearer(const Estimate& difference) {
    if (std::abs(difference.value) <= 2 * difference.error) return "no difference beyond the noise";
    return difference.value < 0 ? "nearer to the truth" : "farther from the truth";
}

std::string sigma_text(const sim3d::Causes& c) {
    const std::string far = nearer(c.sigma[0]), offsets = nearer(c.sigma[1]);
    return far == offsets ? far : "far field: " + far + "; single offsets: " + offsets;
}

std::string causes_of_shape(const sim3d::Causes& c) {
    const auto variant = [&](sim3d::Longitudinal which, const std::string& name, const char* why) {
        const auto k = static_cast<std::size_t>(which);
        return shape_row(name, c.shape[0][k], &c.shape[1][k], why);
    };
    using sim3d::Longitudinal;
    return "<div class=\"wrap\"><table><thead><tr><th>scattered lobe, shape alone</th><th>far field</th><th>single "
           "offsets</th></tr></thead><tbody>" +
           variant(Longitudinal::house, "as published", "C<sup>M</sup> at σ<sub>ms</sub> κ / cos θ<sub>t</sub>") +
           variant(Longitudinal::authors, "C<sup>M</sup> at σ<sub>ms</sub> κ", "the authors’ plug-in") +
           variant(Longitudinal::house_cosine, "C<sup>M</sup> times cos θ<sub>r</sub>",
                   "a slab counts exits per radian of a plane, a cylinder per solid angle; at σ<sub>ms</sub> κ / cos "
                   "θ<sub>t</sub>") +
           variant(Longitudinal::authors_cosine, "the same at σ<sub>ms</sub> κ", sigma_text(c).c_str()) +
           shape_row("over φ alone, with the cosine", c.over_phi[0], &c.over_phi[1],
                     "C<sup>N</sup>: the planar phase function, no refraction or reflection on the way out") +
           shape_row("over θ<sub>r</sub> alone, with the cosine", c.over_theta[0], &c.over_theta[1],
                     "what C<sup>M</sup> times cos θ<sub>r</sub> leaves") +
           shape_row("best product M(θ<sub>r</sub>) N(φ)", c.product[0], &c.product[1],
                     "the truth against the product of its own marginals: what the product form costs") +
           shape_row(
               "smooth cuticle", c.cuticle, nullptr,
               "the truth without tilt and roughness against the truth: what the model leaves out where scattered "
               "light crosses the cuticle") +
           "</tbody></table></div>";
}

std::string causes_of_energy(const ChannelError& all, const sim3d::Causes& c) {
    const auto row = [](const std::string& name, double value, double error, const char* why, const char* kind = "") {
        return fmt::format("<tr class=\"{}\"><td>{}</td><td>{} <small>{}</small></td></tr>", kind, explained(name, why),
                           signed_text(value), noise(error));
    };
    const double difference = all.model_scattered() - all.scattered.value;
    const Estimate &sR = all.truth[6], &R = all.truth[0];
    std::string table =
        "<div class=\"wrap\"><table><thead><tr><th>energy</th><th>model − truth</th></tr></thead><tbody>" +
        row("scattered light", difference, all.scattered.error, "") +
        row("how much light scatters at all", c.entering.value, c.entering.error,
            "cuticle and higher orders: all of the difference if nothing absorbed", "part") +
        row("how much of that is absorbed", c.absorbing.value, c.absorbing.error,
            "T<sub>b</sub> of Eq. 20, the published form, lets scattered light leave at once; in the fibre it may meet "
            "the cuticle beyond the critical angle and stay in",
            "part") +
        row("R", all.model[0] - R.value, R.error, "") +
        row("the Fresnel term", all.model[0] - c.R_smooth, 0,
            "the model’s against the exact one of a smooth cuticle; the published one takes the index η′ for both "
            "polarisations",
            "part") +
        row("tilt and roughness of the cuticle", c.R_smooth - R.value, R.error, "the rest of the difference", "part") +
        "</tbody></table></div>";
    return table +
           fmt::format(
               "<p>A path of scattered light is {:.2f} <small>{}</small> radii long in the cortex and {:.2f} "
               "<small>{}</small> in the medulla, had nothing absorbed; the model takes {:.2f} and {:.2f}. Of all "
               "light, {:.4f} <small>{}</small> leaves after a reflection inside that follows a "
               "collision.</p>",
               c.cortex_length.value, noise(c.cortex_length.error), c.medulla_length.value,
               noise(c.medulla_length.error), c.model_cortex_length, c.model_medulla_length, sR.value, noise(sR.error));
}

/// A number for a cell of a map, with its noise below.
struct MapCell {
    bool defined = true, resolved = true;
    std::string value, error;
    Colour colour = {255, 255, 255};
};

template <class Cell>
std::string map_table(const std::string& title, const std::string& text, const sim3d::ErrorMap& map, Cell&& cell) {
    std::string html = fmt::format(
        "<h3>{}</h3><p class=\"note\">{}</p><div class=\"wrap\"><table class=\"map\"><thead>"
        "<tr><th>|h| \\ θ<sub>i</sub></th>",
        title, text);
    for (const double theta : map.theta_i)
        html += fmt::format("<th>{}{:.3g}</th>", theta < -1e-9 ? "−" : "", std::abs(theta * degrees));
    html += "</tr></thead><tbody>";
    for (std::size_t i = 0; i < map.offsets.size(); ++i) {
        const auto end = [](double h) {
            const std::string number = fmt::format("{:.3g}", h);
            return number.rfind("0.", 0) == 0 ? number.substr(1) : number;
        };
        html += fmt::format("<tr><th>{}–{}</th>", end(map.offsets[i].low), end(map.offsets[i].high));
        for (std::size_t t = 0; t < map.theta_i.size(); ++t) {
            const MapCell c = cell(map.cells[t * map.offsets.size() + i]);
            if (!c.defined)
                html += "<td class=\"blank\">–</td>";
            else if (!c.resolved)
                html += fmt::format("<td class=\"blank\">{}<small>{}</small></td>", c.value, c.error);
            else
                html += fmt::format("<td style=\"background:{};color:{}\">{}<small>{}</small></td>", c.colour.hex(),
                                    c.colour.ink(), c.value, c.error);
        }
        html += "</tr>";
    }
    return html + "</tbody></table></div>";
}

std::string short_number(double x, int digits) {
    std::string text = fmt::format("{:.{}f}", x, digits);
    return text.rfind("0.", 0) == 0 ? text.substr(1) : text;
}

MapCell distance_map_cell(const Distance& d) {
    if (!d.defined) return {false, false, "", "", {}};
    if (!d.resolved()) return {true, false, "&lt;" + short_number(d.bound(), 2), "noise"};
    return {true, true, short_number(d.value(), 2), "±" + short_number(d.error(), 3), plain_scale(d.value())};
}

MapCell energy_map_cell(double model, const Estimate& truth, double reach) {
    const int digits = reach < 0.095 ? 3 : 2;
    const double d = model - truth.value;
    MapCell cell;
    cell.resolved = std::abs(d) > 2 * truth.error;
    cell.value = (d < 0 ? "−" : "+") + short_number(std::abs(d), digits);
    if (cell.value.find_first_not_of("+−.0") == std::string::npos) cell.value = short_number(0, digits);
    cell.error = cell.resolved ? "±" + short_number(truth.error, truth.error < 9.5e-4 ? 4 : 3) : "noise";
    cell.colour = signed_scale(d / reach);
    return cell;
}

std::string maps(const sim3d::ErrorMap& map, std::size_t channel) {
    const auto at = [&](const sim3d::LightError& e) -> const ChannelError& { return e.channels[channel]; };
    const char* scale =
        "0: the model is right. 1: the error is as large as the lobe. Hatched: no scattered light, or less than twice "
        "the noise, with a bound.";
    std::string html = map_table("Scattered lobe: relative L2 error", scale, map,
                                 [&](const auto& e) { return distance_map_cell(at(e).lobe); }) +
                       map_table("Its shape alone", "The model’s lobe is first scaled to the truth’s energy.", map,
                                 [&](const auto& e) { return distance_map_cell(at(e).shape); }) +
                       map_table("Its shape with C<sup>M</sup> times cos θ<sub>r</sub>",
                                 "Likewise, with the cosine of a cylinder’s exits.", map,
                                 [&](const auto& e) { return distance_map_cell(at(e).cosine); });
    const auto energies = [&](const char* name, auto&& model, auto&& truth) {
        double reach = 0;
        for (const auto& e : map.cells) reach = std::max(reach, std::abs(model(at(e)) - truth(at(e)).value));
        if (reach < 5e-4) {
            html += fmt::format(
                "<h3>Energy of {}: model − truth</h3><p class=\"note\">Less than 0.0005 in every "
                "cell.</p>",
                name);
            return;
        }
        html += map_table(fmt::format("Energy of {}: model − truth", name),
                          "In shares of the light that meets these offsets; red: the model has too much, blue: too "
                          "little. Hatched: less than twice the noise.",
                          map, [&](const auto& e) { return energy_map_cell(model(at(e)), truth(at(e)), reach); });
    };
    energies(
        "scattered light", [](const ChannelError& e) { return e.model_scattered(); },
        [](const ChannelError& e) { return e.scattered; });
    const char* names[] = {"R", "TT", "TRT"};
    for (std::size_t k = 0; k < 3; ++k)
        energies(
            names[k], [k](const ChannelError& e) { return e.model[k]; },
            [k](const ChannelError& e) { return e.truth[k]; });
    return html;
}

std::string far_field(const sim3d::ErrorMap& map, std::size_t channel) {
    std::string rows;
    PageCurve curves[] = {{"truth", "truth"}, {"model", "model"}, {"truth", "truth"},
                          {"model", "model"}, {"model", "model"}, {"with cos θ<sub>r</sub>", "cosine"}};
    for (const auto& light : map.far) {
        const ChannelError& e = light.channels[channel];
        const double theta = light.theta_i * degrees;
        const auto pair = [&](double model, const Estimate& truth) {
            return fmt::format("<td>{:.4f} <small>{}</small></td><td>{:.4f}</td>", truth.value, noise(truth.error),
                               model);
        };
        rows += fmt::format("<tr><td>{}{:.3g}</td>", theta < -1e-9 ? "−" : "", std::abs(theta)) +
                pair(e.model_scattered(), e.scattered) + pair(e.model[0], e.truth[0]) + distance_cell(e.lobe) +
                distance_cell(e.shape) + distance_cell(e.cosine) + "</tr>";
        const double y[] = {e.scattered.value, e.model_scattered(), e.truth[0].value,
                            e.model[0],        e.shape.value(),     e.cosine.value()};
        const bool defined[] = {true, true, true, true, e.shape.defined, e.cosine.defined};
        for (std::size_t k = 0; k < 6; ++k)
            if (defined[k]) curves[k].x.push_back(theta), curves[k].y.push_back(y[k]);
    }
    return "<div class=\"charts\">" + page_chart("scattered energy against θ<sub>i</sub>", {curves[0], curves[1]}) +
           page_chart("energy of R against θ<sub>i</sub>", {curves[2], curves[3]}) +
           page_chart("relative L2 error of the scattered shape", {curves[4], curves[5]}) +
           "</div><div "
           "class=\"wrap\"><table><thead><tr><th>θ<sub>i</sub></th><th>scattered<br>truth</th><th>scattered<br>model</"
           "th>"
           "<th>R<br>truth</th><th>R<br>model</th><th>scattered lobe<br>rel. L2</th><th>its shape</th><th>with<br>cos "
           "θ<sub>r</sub></th></tr></thead><tbody>" +
           rows + "</tbody></table></div>";
}

std::string directions(const ErrorMapTitle& title, const sim3d::ErrorMap& map, std::size_t channel) {
    const double alpha = double(title.material.fur.alpha) * degrees, beta = double(title.material.fur.beta_m) * degrees;
    const double shift[] = {alpha, -alpha / 2, -1.5 * alpha}, deviation[] = {beta, beta / 2, 1.5 * beta};
    std::string rows;
    const auto cell = [](const Estimate& e, bool with_sign) {
        if (e.error == 0 && e.value == 0) return std::string("<td class=\"quiet\">too little light</td>");
        const double angle = e.value * degrees;
        return fmt::format("<td>{} <small>{}</small></td>",
                           with_sign ? signed_text(angle, 2) : fmt::format("{:.2f}", angle), noise(e.error * degrees));
    };
    for (const auto& light : map.far) {
        rows +=
            fmt::format("<tr><td>{}{:.3g}</td>", light.theta_i < -1e-9 ? "−" : "", std::abs(light.theta_i * degrees));
        for (std::size_t p = 0; p < 3; ++p)
            rows += cell(light.channels[channel].shift[p], true) + cell(light.channels[channel].deviation[p], false);
        rows += "</tr>";
    }
    std::string model = "<tr class=\"sum\"><td>model</td>";
    for (std::size_t p = 0; p < 3; ++p)
        model += fmt::format("<td>{}</td><td>{:.2f}</td>", signed_text(shift[p], 2), deviation[p]);
    return "<div class=\"wrap\"><table><thead><tr><th>θ<sub>i</sub></th><th>R<br>shift</th><th>deviation</th><th>TT<br>"
           "shift</th><th>deviation</th><th>TRT<br>shift</th><th>deviation</th></tr></thead><tbody>" +
           rows + model + "</tr></tbody></table></div>";
}

std::string percent(double model, const Estimate& truth) {
    const double d = model - truth.value;
    if (std::abs(d) <= 2 * truth.error) return "the same within the noise";
    return fmt::format("{:.0f} % too {}", std::abs(100 * d / truth.value), d > 0 ? "much" : "little");
}

/// The answer in two sentences.
std::string answer(const ChannelError& e) {
    if (!(e.model_scattered() > 0))
        return fmt::format("R is {:.3f} of the light that meets the fibre; in the model {:.3f}, {}. Nothing scatters.",
                           e.truth[0].value, e.model[0], percent(e.model[0], e.truth[0]));
    const auto text = [](const Distance& d) {
        if (!d.resolved()) return fmt::format("below {:.3f}, the noise", d.bound());
        return fmt::format("{:.3f}", d.value());
    };
    // The corrected form has the cosine.
    const std::string cosine =
        e.shape.square.value == e.cosine.square.value
            ? ""
            : fmt::format(", and of {} once C<sup>M</sup> is multiplied by cos θ<sub>r</sub>", text(e.cosine));
    return fmt::format(
        "Of the light that meets the fibre, {:.3f} leaves scattered by the medulla; in the model {:.3f}, {}. The shape "
        "of the scattered lobe has a relative L2 error of {}{}. R is {:.3f}; in the model {:.3f}, {}.",
        e.scattered.value, e.model_scattered(), percent(e.model_scattered(), e.scattered), text(e.shape), cosine,
        e.truth[0].value, e.model[0], percent(e.model[0], e.truth[0]));
}

std::string work(const ErrorMapTitle& title, const sim3d::ErrorMap& map) {
    const FurParameters<3>& p = title.material.fur;
    std::string sigma_ca = fmt::format("{:.4g}", p.sigma_ca[0]);
    for (std::size_t c = 1; c < title.channels(); ++c) sigma_ca += fmt::format(", {:.4g}", p.sigma_ca[c]);
    std::string html = fmt::format(
        "<p>κ {:.4g}, η {:.4g}, α {:.4g}°, β<sub>m</sub> {:.4g}°, β<sub>n</sub> {:.4g}°, {:.4g} layers, σ<sub>ca</sub> "
        "{}, σ<sub>ms</sub> {:.4g}, σ<sub>ma</sub> {:.4g} per fibre radius, g {:.4g}. Model: {} Fresnel "
        "term, {} form of the scattered lobes.</p>",
        p.kappa, p.eta, double(p.alpha) * degrees, double(p.beta_m) * degrees, double(p.beta_n) * degrees, p.layers,
        sigma_ca, p.sigma_ms, p.sigma_ma, p.g, p.fresnel == Fresnel::exact ? "exact" : "published",
        p.scattering == Scattering::corrected ? "corrected" : "published");
    html += fmt::format(
        "<p>Truth: {:.3g} million paths through the fibre in three dimensions (smooth fibre included), {} for each "
        "cell of the "
        "maps, seed {}; rough tilted cuticle, absorbing cortex, scattering and absorbing medulla. Model: Yan et al. "
        "2017 straight from the formulas, with C<sup>N</sup> and C<sup>M</sup> of the noise-free solvers: no table, no "
        "pack. Lobes are densities per radian² of (θ<sub>r</sub>, φ) in bins of {:.3g}° × {:.3g}°. Relative L2 error: "
        "|model − truth| / |truth| over the bins, the truth’s noise subtracted. ± is one standard error of the truth, "
        "from 16 batches; the model has no noise.</p>",
        double(map.paths) * 1e-6, title.paths, title.seed, 180.0 / double(map.pictures[0].truth.theta_bins),
        360.0 / double(map.pictures[0].truth.phi_bins));
    if (map.lost.value > 1e-4)
        html += fmt::format(
            "<p>Up to {:.4f} <small>{}</small> of the light was still inside after 10,000 flights and "
            "is missing from the truth.</p>",
            map.lost.value, noise(map.lost.error));
    return html;
}

}  // namespace

std::string error_map_page(const ErrorMapTitle& title, const sim3d::ErrorMap& map) {
    const std::size_t channels = title.channels(), shown = channels / 2;
    const std::string name = escaped(title.material.name.empty() ? "fibre" : title.material.name);
    const std::string of_shown = channels > 1 ? fmt::format(" The {} channel.", title.channel(shown)) : "";
    std::string html = fmt::format(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
        "content=\"width=device-width,initial-scale=1\"><title>{0}: five-lobe model against light in the fibre</title>"
        "<style>{1}</style></head><body>\n<h1>{0}: the five-lobe model against light in the fibre</h1>\n<p>{2}</p>\n",
        name, error_map_style, answer(map.all.channels[shown]));
    html +=
        "<h2>Energy</h2><p class=\"note\">Light from all directions alike, at all offsets; shares of the light that "
        "meets the fibre.</p>";
    for (std::size_t c = 0; c < channels; ++c) {
        if (channels > 1) html += fmt::format("<h3>{}</h3>", title.channel(c));
        html += energy_table(map.all.channels[c]) + "\n";
    }
    html += fmt::format("<p class=\"note\">The runtime’s residual lobe adds {:.4f} for paths after TRT.</p>",
                        map.all.channels[shown].model[5]);
    html +=
        "<h2>What the difference comes from</h2><p class=\"note\">Light from all directions "
        "alike; relative L2 errors. C<sup>N</sup> is the table over φ (unit disc), C<sup>M</sup> the one over "
        "θ<sub>r</sub> (slab)." +
        of_shown + "</p>" + causes_of_shape(map.causes[shown]) + "\n" +
        causes_of_energy(map.all.channels[shown], map.causes[shown]) + "\n";
    html += "<h2>Far field by inclination</h2><p class=\"note\">All offsets; θ<sub>i</sub> in degrees." + of_shown +
            "</p>" + far_field(map, shown) + "\n";
    html += "<h2>Maps over inclination and offset</h2><p class=\"note\">Columns: θ<sub>i</sub> in degrees. Rows: |h|." +
            of_shown + "</p>" + maps(map, shown) + "\n";
    html +=
        "<h2>Lobes of scattered light</h2><p class=\"note\">φ = 0 is back towards the light. In the differences, "
        "red: the model has too much; blue: too little; grey: less than twice the standard error of the bin." +
        of_shown + "</p>";
    for (const bool far : {true, false})
        for (const sim3d::LobePicture& p : map.pictures) {
            if (far != (p.offsets.low == 0 && p.offsets.high == 1)) continue;
            const double theta = p.theta_i * degrees;
            const std::string where =
                far ? std::string("far field") : fmt::format("h from {:.3g} to {:.3g}", p.offsets.low, p.offsets.high);
            html += fmt::format("<h3>θ<sub>i</sub> = {}{:.3g}°, {}</h3>", theta < -1e-9 ? "−" : "", std::abs(theta),
                                where) +
                    lobe_pictures(p) + "\n";
        }
    html +=
        "<h2>Where R, TT and TRT leave</h2><p class=\"note\">Shift: mean of θ<sub>r</sub> + θ<sub>i</sub>; deviation "
        "of θ<sub>r</sub>; degrees, far field." +
        of_shown + " Model: Table 2, before truncation at ±90°.</p>" + directions(title, map, shown) + "\n";
    return html + "<h2>What was compared</h2>" + work(title, map) + "</body></html>\n";
}

}  // namespace medulla::tables
