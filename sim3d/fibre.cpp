#include "sim3d/fibre.hpp"

#include <cmath>
#include <sstream>
#include <stdexcept>

#include "medulla/config.hpp"

namespace medulla::sim3d {
namespace {

void require(bool condition, const char* field, const char* expected, double found) {
    if (condition) return;
    std::ostringstream text;
    text << field << ": expected " << expected << ", found " << found;
    throw std::invalid_argument(text.str());
}

bool within(double x, double low, double high) { return x >= low && x <= high; }

}  // namespace

void validate(const Fibre& f, const Light& light, const FibreOptions& o) {
    require(f.eta_c > 1 && f.eta_c <= 10, "eta_c", "a value in (1, 10]", f.eta_c);
    if (f.eta_m) require(within(*f.eta_m, 1, 10), "eta_m", "a value in [1, 10]", *f.eta_m);
    require(within(f.kappa, 0, 1), "kappa", "a value in [0, 1]", f.kappa);
    require(within(f.alpha, -pi / 4, pi / 4), "alpha", "radians in [-pi/4, pi/4]", f.alpha);
    require(within(f.beta_m, 0, 2), "beta_m", "radians in [0, 2]", f.beta_m);
    require(within(f.beta_n, 0, 2), "beta_n", "radians in [0, 2]", f.beta_n);
    require(within(f.layers, 0, 1000), "layers", "a value in [0, 1000]", f.layers);
    require(within(double(f.sigma_ca.size()), 1, 64), "sigma_ca", "1 to 64 channels", double(f.sigma_ca.size()));
    for (const double s : f.sigma_ca) require(within(s, 0, 1e9), "sigma_ca", "values in [0, 1e9]", s);
    require(within(f.sigma_ma, 0, 1e9), "sigma_ma", "a value in [0, 1e9]", f.sigma_ma);
    require(within(f.sigma_ms, 0, 1e6), "sigma_ms", "a value in [0, 1e6]", f.sigma_ms);
    require(f.g > -1 && f.g < 1, "g", "a value in (-1, 1)", f.g);
    require(within(f.axis_ratio, 0.1, 10), "axis_ratio", "a value in [0.1, 10]", f.axis_ratio);
    require(std::abs(light.theta_i) < pi / 2, "theta_i", "radians in (-pi/2, pi/2)", light.theta_i);
    require(within(light.h_low, -1, 1), "h_low", "a value in [-1, 1]", light.h_low);
    require(within(light.h_high, light.h_low, 1), "h_high", "a value in [h_low, 1]", light.h_high);
    require(std::isfinite(light.azimuth), "azimuth", "finite radians", light.azimuth);
    require(within(double(o.paths), 1, 0x1p40), "paths", "1 to 2^40", double(o.paths));
    require(within(o.target_error, 0, 1), "target_error", "a value in [0, 1]", o.target_error);
    require(within(double(o.batches), 2, 1024), "batches", "2 to 1024", double(o.batches));
    require(within(double(o.theta_bins), 1, 4096), "theta_bins", "1 to 4096", double(o.theta_bins));
    require(within(double(o.phi_bins), 1, 4096), "phi_bins", "1 to 4096", double(o.phi_bins));
    const double sums = 7.0 * double(f.sigma_ca.size()) * double(o.batches * o.theta_bins * o.phi_bins);
    require(sums <= 0x1p31, "theta_bins, phi_bins", "at most 2^31 sums over all classes, channels and batches", sums);
}

}  // namespace medulla::sim3d
