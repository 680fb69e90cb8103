#include "tables/job/scene.hpp"

#include <algorithm>
#include <cmath>

#include "tables/error.hpp"

namespace medulla::tables {
namespace {

/// Marks the nodes around [low, high], and one more on either side.
void mark(const Axis& axis, double low, double high, std::vector<bool>& needed) {
    const auto begin = axis.values.begin(), end = axis.values.end();
    const auto above = std::upper_bound(begin, end, low) - begin, beyond = std::lower_bound(begin, end, high) - begin;
    const auto last = static_cast<std::ptrdiff_t>(axis.size()) - 1;
    const auto first = std::max<std::ptrdiff_t>(0, above - 2), stop = std::min(last, beyond + 1);
    for (auto i = first; i <= stop; ++i) needed[static_cast<std::size_t>(i)] = true;
}

void keep(Axis& axis, const std::vector<bool>& needed) {
    std::vector<double> kept;
    for (std::size_t i = 0; i < axis.size(); ++i)
        if (needed[i]) kept.push_back(axis.values[i]);
    axis.values = std::move(kept);
}

}  // namespace

std::optional<Needs> needs_of(const FurParameters<3>& fur) {
    const double kappa = double(fur.kappa), sigma = double(fur.sigma_ms) * kappa, eta = double(fur.eta);
    if (!(sigma > 0)) return std::nullopt;
    const double cos_t = std::sqrt((eta - 1) * (eta + 1)) / eta;
    const double absorption = double(fur.sigma_ma) * kappa;
    return Needs{sigma, sigma / cos_t, absorption, absorption / cos_t, double(fur.g), std::min(1.0, 1 / (eta * kappa))};
}

Request restrict_to(const Request& request, const std::vector<Material>& materials, std::vector<std::string>& notes) {
    std::vector<bool> sigma(request.sigma.size()), g(request.g.size()), h(request.h.size()),
        absorption(request.absorption.size());
    bool any = false;
    for (std::size_t i = 0; i < materials.size(); ++i) {
        const Material& material = materials[i];
        const std::optional<Needs> needs = needs_of(material.fur);
        if (!needs) continue;
        any = true;
        const std::string name = material.name.empty() ? fmt::format("/materials/{}", i)
                                                       : fmt::format("/materials/{} ({})", i, material.name);
        const auto cover = [&](const Axis& axis, double low, double high, std::vector<bool>& needed) {
            const double least = axis.values.front(), greatest = axis.values.back();
            if (low > greatest || high < least)
                throw Error("{}: needs {} {:g} .. {:g}, the axis has {:g} .. {:g}; widen its range", name, axis.name,
                            low, high, least, greatest);
            if (low < least || high > greatest)
                notes.push_back(
                    fmt::format("{}: needs {} {:g} .. {:g}, the axis has {:g} .. {:g}: values are clamped "
                                "to its ends",
                                name, axis.name, low, high, least, greatest));
            mark(axis, low, high, needed);
        };
        cover(request.sigma, needs->sigma_low, needs->sigma_high, sigma);
        cover(request.g, needs->g, needs->g, g);
        cover(request.h, request.h.values.front(), needs->h_high, h);
        if (request.absorption.size() > 0)
            cover(request.absorption, needs->absorption_low, needs->absorption_high, absorption);
    }
    if (!any) throw Error("/materials: expected a scattering medulla (sigma_ms kappa > 0), found none");
    Request part = request;
    keep(part.sigma, sigma), keep(part.g, g), keep(part.h, h), keep(part.absorption, absorption);
    return part;
}

}  // namespace medulla::tables
