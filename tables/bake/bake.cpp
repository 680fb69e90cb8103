#include "tables/bake/bake.hpp"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

#include "medulla/detail/cross_section.hpp"
#include "tables/error.hpp"
#include "tables/store/json_text.hpp"
#include "tensor/mirrored.hpp"

namespace medulla::tables {
namespace {

using tensor::RowMatrix;

/// Less scattered light than this, of what meets the fibre, is taken for none.
constexpr double least_light = 1e-6;

/// Closed forms at a node (baked_field.hpp has the same in floats).
struct NodeForms {
    double R, entered, turn, shortest;  ///< turn: 2 gamma_t - 2 gamma_i; shortest: l of BakedHeader
};
NodeForms forms_at(const FurParameters<3>& p, double theta_i, double h) {
    const auto at = detail::inclination(static_cast<double>(p.eta), std::cos(theta_i), Fresnel::exact);
    const auto path =
        detail::trace(at, static_cast<double>(p.kappa), static_cast<double>(p.layers), h, std::sqrt((1 - h) * (1 + h)));
    const double F = path.cuticle.F, T = path.cuticle.T_;
    const double x = std::exp(-2 * static_cast<double>(p.sigma_ms) * path.s_m * at.inverse_cos_t);
    const double stays = T + F * (1 - x);
    return {F, stays > 0 ? T * T * x / stays : 0, 2 * (path.gamma_t - path.gamma_i),
            path.s_c * at.inverse_cos_t + (1 - static_cast<double>(p.kappa))};
}

/// Functions that are bilinear between the centres of bins: their averages over the bins, and back.
class Bins {
  public:
    Bins(std::size_t rows, std::size_t columns) : rows_(rows), columns_(columns) {}

    /// The function at phi becomes that at phi + turn: band-limited.
    void turn(const float* from, double turn, double* to) const {
        convolve(from, kernel([&](double f, double phi) { return std::cos(f * (phi + turn)); }, false), to);
    }
    /// Values at the centres -> averages over the bins.
    RowMatrix averages(const RowMatrix& nodes) const {
        RowMatrix result(nodes.rows(), nodes.cols());
        for (Eigen::Index k = 0; k < nodes.rows(); ++k) {
            const double* x = nodes.row(k).data();
            std::vector<double> along(rows_ * columns_);
            for (std::size_t r = 0; r < rows_; ++r)
                for (std::size_t c = 0; c < columns_; ++c) {
                    const std::size_t i = r * columns_ + c;
                    // Beyond the outermost centres the function falls to 0 at the pole.
                    const bool first = r == 0, last = r + 1 == rows_;
                    along[i] = (first || last ? 0.625 : 0.75) * x[i] + (first ? 0 : 0.125 * x[i - columns_]) +
                               (last ? 0 : 0.125 * x[i + columns_]);
                }
            for (std::size_t r = 0; r < rows_; ++r)
                for (std::size_t c = 0; c < columns_; ++c) {
                    const double* row = along.data() + r * columns_;
                    result(k, static_cast<Eigen::Index>(r * columns_ + c)) =
                        0.75 * row[c] + 0.125 * (row[(c + 1) % columns_] + row[(c + columns_ - 1) % columns_]);
                }
        }
        return result;
    }
    /// Averages over the bins -> values at the centres, not negative.
    RowMatrix nodes(const RowMatrix& averages) const {
        RowMatrix result(averages.rows(), averages.cols());
        const std::vector<double> inverse = kernel([](double f, double phi) { return std::cos(f * phi); }, true);
        for (Eigen::Index k = 0; k < averages.rows(); ++k) {
            double* x = result.row(k).data();
            convolve(averages.row(k).data(), inverse, x);
            solve_rows(x);
        }
        return result.cwiseMax(0);
    }

  private:
    /// Of a circular convolution over phi, from its Fourier series. @param sharp divided by what averaging over a bin
    /// does to a function that is linear between the centres
    template <class Wave>
    std::vector<double> kernel(Wave&& wave, bool sharp) const {
        const double n = static_cast<double>(columns_);
        std::vector<double> result(columns_);
        for (std::size_t i = 0; i < columns_; ++i) {
            const double phi = 2 * pi * static_cast<double>(i) / n;
            double sum = 1;
            for (std::size_t m = 1; 2 * m <= columns_; ++m) {
                const double f = static_cast<double>(m), average = sharp ? 0.75 + 0.25 * std::cos(2 * pi * f / n) : 1;
                // The highest wave is the mean of its two directions.
                sum += (2 * m == columns_ ? 0.5 * (wave(f, phi) + wave(-f, phi)) : 2 * wave(f, phi)) / average;
            }
            result[i] = sum / n;
        }
        return result;
    }
    template <class T>
    void convolve(const T* from, const std::vector<double>& kernel, double* to) const {
        for (std::size_t r = 0; r < rows_; ++r)
            for (std::size_t q = 0; q < columns_; ++q) {
                double sum = 0;
                for (std::size_t p = 0; p < columns_; ++p)
                    sum += kernel[(q + columns_ - p) % columns_] * static_cast<double>(from[r * columns_ + p]);
                to[r * columns_ + q] = sum;
            }
    }
    /// Over theta_r: the tridiagonal system of `averages`.
    void solve_rows(double* x) const {
        std::vector<double> upper(rows_);
        for (std::size_t q = 0; q < columns_; ++q) {
            double pivot = 0.625;
            x[q] /= pivot;
            for (std::size_t r = 1; r < rows_; ++r) {
                upper[r] = 0.125 / pivot;
                pivot = (r + 1 == rows_ ? 0.625 : 0.75) - 0.125 * upper[r];
                x[r * columns_ + q] = (x[r * columns_ + q] - 0.125 * x[(r - 1) * columns_ + q]) / pivot;
            }
            for (std::size_t r = rows_ - 1; r-- > 0;) x[r * columns_ + q] -= upper[r + 1] * x[(r + 1) * columns_ + q];
        }
    }

    std::size_t rows_, columns_;
};

/// Everything that a pack has beside its header.
struct Parts {
    std::vector<unsigned char> functions, coefficients;  ///< as BakedHeader has them
    std::vector<std::uint32_t> sums;
    std::vector<float> scales, energies;
};

/// Functions as squares of bytes. @return the functions that these stand for, each of integral 1
RowMatrix round_functions(const RowMatrix& B, const FibreRequest& r, Parts& parts) {
    const auto K = static_cast<std::size_t>(B.rows()), bins = r.rows * r.columns;
    RowMatrix rounded(B.rows(), B.cols());
    parts.functions.resize(bins * K), parts.sums.resize(K * r.rows);
    const double node_area = pi / static_cast<double>(r.rows) * (2 * pi / static_cast<double>(r.columns));
    for (std::size_t k = 0; k < K; ++k) {
        const auto row_k = static_cast<Eigen::Index>(k);
        const double greatest = B.row(row_k).maxCoeff();
        double whole = 0;
        for (std::size_t row = 0; row < r.rows; ++row) {
            std::uint32_t sum = 0;
            for (std::size_t column = 0; column < r.columns; ++column) {
                const std::size_t bin = row * r.columns + column;
                const auto q = static_cast<unsigned>(
                    std::lround(255 * std::sqrt(B(row_k, static_cast<Eigen::Index>(bin)) / greatest)));
                parts.functions[bin * K + k] = static_cast<unsigned char>(q);
                rounded(row_k, static_cast<Eigen::Index>(bin)) = q * q;
                sum += q * q;
            }
            parts.sums[k * r.rows + row] = sum;
            whole += 0.25 * sum * detail::row_area(static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(r.rows));
        }
        rounded.row(row_k) /= whole * node_area;
    }
    return rounded;
}

/// Shares of E, [cell][absorption][2 K], as squares of bytes.
void round_coefficients(const RowMatrix& shares, Parts& parts) {
    parts.coefficients.resize(static_cast<std::size_t>(shares.size()));
    for (Eigen::Index i = 0; i < shares.rows(); ++i) {
        const double greatest = shares.row(i).maxCoeff();
        double squares = 0;
        for (Eigen::Index k = 0; k < shares.cols(); ++k) {
            const double q = greatest > 0 ? std::nearbyint(255 * std::sqrt(shares(i, k) / greatest)) : 0;
            parts.coefficients[static_cast<std::size_t>(i * shares.cols() + k)] = static_cast<unsigned char>(q);
            squares += q * q;
        }
        // Rounding keeps the energy.
        parts.scales.push_back(squares > 0 ? static_cast<float>(shares.row(i).sum() / squares) : 0.0f);
    }
}

std::vector<unsigned char> write_baked(const FibreLight& light, const BakeOptions& options, const Parts& parts,
                                       std::size_t K, const BakeErrors& errors, const std::string& provenance) {
    const FibreRequest& r = light.request;
    const FurParameters<3>& p = r.material.fur;
    std::vector<unsigned char> bytes(sizeof(BakedHeader));
    const auto append = [&](const void* data, std::size_t size) {
        const std::size_t at = (bytes.size() + 3) / 4 * 4;
        bytes.resize(at + size);
        if (size > 0) std::memcpy(bytes.data() + at, data, size);
        return static_cast<std::uint32_t>(at);
    };
    const auto whole = [](std::size_t n) { return static_cast<std::uint32_t>(n); };
    BakedHeader h = {};
    std::memcpy(h.magic, baked_magic, sizeof h.magic);
    h.version = baked_version, h.functions = whole(K), h.rows = whole(r.rows), h.columns = whole(r.columns);
    h.inclinations = whole(r.inclinations), h.offsets_inside = whole(r.offsets_inside);
    h.offsets_beyond = whole(r.offsets_beyond);
    h.bytes_offset = append(parts.functions.data(), parts.functions.size());
    h.sums_offset = append(parts.sums.data(), 4 * parts.sums.size());
    h.cells_offset = append(parts.coefficients.data(), parts.coefficients.size());
    h.scales_offset = append(parts.scales.data(), 4 * parts.scales.size());
    h.energies_offset = append(parts.energies.data(), 4 * parts.energies.size());
    h.text_offset = append(provenance.data(), provenance.size()), h.text_bytes = whole(provenance.size());
    h.theta_high = static_cast<float>(greatest_inclination), h.turn = static_cast<float>(options.turn);
    h.sigma_middle = middle_of_absorption;
    for (int j = 0; j < absorption_nodes; ++j)
        h.sigma[j] = static_cast<float>(light.sigma_ca[static_cast<std::size_t>(j)]);
    h.eta = p.eta, h.kappa = p.kappa, h.alpha = p.alpha, h.beta_m = p.beta_m, h.beta_n = p.beta_n;
    h.layers = p.layers, h.sigma_ms = p.sigma_ms, h.sigma_ma = p.sigma_ma, h.g = p.g;
    for (int c = 0; c < 3; ++c) h.sigma_ca[c] = p.sigma_ca[c];
    h.median_error = static_cast<float>(errors.median), h.worst_error = static_cast<float>(errors.worst);
    h.byte_count = bytes.size();
    std::memcpy(bytes.data(), &h, sizeof h);
    h.checksum = pack_checksum(bytes.data(), bytes.size());
    std::memcpy(bytes.data(), &h, sizeof h);
    if (const BakedStatus status = open_baked(bytes.data(), bytes.size()).status; status != BakedStatus::ok)
        throw Error("pack: written bytes do not open: {}", describe(status));
    return bytes;
}

/// Light at the nodes as rows [cell][absorption], turned; rows of cells without light are 0.
RowMatrix node_rows(const FibreLight& light, double turn) {
    const std::size_t sigmas = light.sigma_ca.size(), bins = light.bins();
    RowMatrix X =
        RowMatrix::Zero(static_cast<Eigen::Index>(light.cells.size() * sigmas), static_cast<Eigen::Index>(bins));
    const Bins bins_of(light.request.rows, light.request.columns);
#pragma omp parallel for schedule(dynamic, 1)
    for (std::size_t i = 0; i < light.cells.size(); ++i) {
        const LightCell& cell = light.cells[i];
        if (!(cell.scattered > least_light)) continue;
        const double by = turn * forms_at(light.request.material.fur, cell.theta_i, cell.h).turn;
        for (std::size_t j = 0; j < sigmas; ++j)
            bins_of.turn(cell.density.data() + j * bins, by, X.row(static_cast<Eigen::Index>(i * sigmas + j)).data());
    }
    return X;
}

/// Energies of a cell over their closed forms. What has next to no energy has the closed form's.
void add_energies(const FibreLight& light, Parts& parts) {
    for (const LightCell& cell : light.cells) {
        const NodeForms forms = forms_at(light.request.material.fur, cell.theta_i, cell.h);
        const auto ratio = [](double simulated, double closed) {
            constexpr double none = 1e-5;
            return static_cast<float>(std::clamp((simulated + none) / (closed + none), 0.0, 16.0));
        };
        parts.energies.push_back(ratio(cell.R, forms.R)), parts.energies.push_back(ratio(cell.entered, forms.entered));
    }
}

/// What scattered at a node has, as shares of E: energies are exactly those that were simulated.
RowMatrix shares_of(const FibreLight& light, const RowMatrix& C) {
    const std::size_t sigmas = light.sigma_ca.size(), bins = light.bins();
    const std::size_t offsets = light.cells.size() / light.request.inclinations;
    const double bin_area =
        pi / static_cast<double>(light.request.rows) * (2 * pi / static_cast<double>(light.request.columns));
    const Eigen::Index K = C.cols() / 2;
    RowMatrix shares = RowMatrix::Zero(C.rows(), C.cols());
    for (std::size_t i = 0; i < light.cells.size(); ++i) {
        const LightCell& cell = light.cells[i];
        const double shortest = forms_at(light.request.material.fur, cell.theta_i, cell.h).shortest;
        for (std::size_t j = 0; j < sigmas; ++j) {
            const auto row = static_cast<Eigen::Index>(i * sigmas + j);
            double energy = 0;
            for (std::size_t b = 0; b < bins; ++b) energy += static_cast<double>(cell.density[j * bins + b]) * bin_area;
            const double sum = C.row(row).sum();
            if (cell.scattered > least_light && sum > 0 && energy > 0) {
                shares.row(row) =
                    C.row(row) * (energy * std::exp(light.sigma_ca[j] * shortest) / (sum * cell.scattered));
                if (i % offsets == 0) {  // h = 0: its own mirror image
                    const Eigen::RowVectorXd mean = 0.5 * (shares.row(row).head(K) + shares.row(row).tail(K));
                    shares.row(row).head(K) = mean, shares.row(row).tail(K) = mean;
                }
            } else if (i % offsets > 0) {
                shares.row(row) = shares.row(row - static_cast<Eigen::Index>(sigmas));  // the limit from inside
            }
        }
    }
    return shares;
}

/// Relative L2 standard error of the lobe of row [cell][absorption].
double noise_of(const FibreLight& light, std::size_t row) {
    const std::size_t bins = light.bins(), first = row % light.sigma_ca.size() * bins;
    const LightCell& cell = light.cells[row / light.sigma_ca.size()];
    double errors = 0, values = 0;
    for (std::size_t b = first; b < first + bins; ++b) {
        const double e = static_cast<double>(cell.error[b]), v = static_cast<double>(cell.density[b]);
        errors += e * e, values += v * v;
    }
    return values > 0 ? std::sqrt(errors / values) : 1;
}

BakeResult bake_with(const FibreLight& light, const BakeOptions& options, const RowMatrix& X, int functions,
                     const std::string& input) {
    const FibreRequest& r = light.request;
    std::vector<Eigen::Index> mirror(light.bins());
    for (std::size_t b = 0; b < mirror.size(); ++b)
        mirror[b] = static_cast<Eigen::Index>(b / r.columns * r.columns + (r.columns - 1 - b % r.columns));
    const Eigen::VectorXd norms = X.rowwise().norm();
    // Every lobe counts alike, but for its noise; absorptions that are between others do not make the functions.
    std::vector<Eigen::Index> lit, fitted;
    for (Eigen::Index i = 0; i < X.rows(); ++i)
        if (norms[i] > 0) lit.push_back(i);
    if (lit.empty()) throw Error("{}: expected scattered light, found none", input);
    for (const Eigen::Index i : lit)
        if (i % absorption_nodes % 2 == 0) fitted.push_back(i);
    /// @param trust weight of a lobe by its noise
    const auto rows_of = [&](const std::vector<Eigen::Index>& chosen, auto&& trust) {
        RowMatrix rows(static_cast<Eigen::Index>(chosen.size()), X.cols());
        for (std::size_t i = 0; i < chosen.size(); ++i)
            rows.row(static_cast<Eigen::Index>(i)) = X.row(chosen[i]) * (trust(chosen[i]) / norms[chosen[i]]);
        return rows;
    };
    const auto by_noise = [&](Eigen::Index row) {
        constexpr double fair = 0.05;
        const double noise = noise_of(light, static_cast<std::size_t>(row)) / fair;
        return 1 / (1 + noise * noise);
    };
    tensor::MirroredOptions factor;
    factor.rank = functions, factor.sweeps = options.sweeps, factor.seed = options.seed;
    const tensor::MirroredResult factors = tensor::mirrored_factors(rows_of(fitted, by_noise), mirror, factor);
    Parts parts;
    const Bins bins(r.rows, r.columns);
    const RowMatrix rounded = round_functions(bins.nodes(factors.B), r, parts);
    const RowMatrix F = tensor::with_mirrored(bins.averages(rounded), mirror);
    const RowMatrix found = tensor::nonnegative_coefficients(rows_of(lit, [](Eigen::Index) { return 1.0; }), F, 500);
    RowMatrix C = RowMatrix::Zero(X.rows(), F.rows());
    for (std::size_t i = 0; i < lit.size(); ++i)
        C.row(lit[i]) = found.row(static_cast<Eigen::Index>(i)) * norms[lit[i]];
    round_coefficients(shares_of(light, C), parts);
    add_energies(light, parts);

    BakeResult result;
    result.functions = functions, result.sweeps = factors.sweeps, result.fit = factors.error,
    result.noise = median_noise(light);
    const auto write = [&](const std::string& provenance) {
        return write_baked(light, options, parts, static_cast<std::size_t>(functions), result.errors, provenance);
    };
    // Checked as the runtime has it, then written again with the errors found.
    const std::vector<unsigned char> unchecked = write("{}");
    const BakedMaterial material = open_baked(unchecked.data(), unchecked.size()).material;
    result.errors = errors_against(material, light.checks, light.check_sigma_ca, r.rows, r.columns);
    const nlohmann::ordered_json provenance = {
        {"program", "medulla " MEDULLA_VERSION},
        {"input", input},
        {"name", r.material.name},
        {"simulation",
         {{"program", light.program}, {"seed", r.seed}, {"paths", r.paths}, {"check_paths", r.check_paths}}},
        {"seed", options.seed},
        {"sweeps", factors.sweeps},
        {"relative_l2",
         {{"median", result.errors.median}, {"worst", result.errors.worst}, {"lobes", result.errors.lobes}}}};
    result.pack = write(json_line(provenance));
    return result;
}

}  // namespace

std::size_t baked_bytes(const FibreRequest& r, int functions) {
    const auto K = static_cast<std::size_t>(functions);
    const std::size_t cells = r.inclinations * (r.offsets_inside + r.offsets_beyond);
    return sizeof(BakedHeader) + r.rows * r.columns * K + 4 * K * r.rows + cells * (absorption_nodes * (2 * K + 4) + 8);
}

BakeResult bake(const FibreLight& light, const BakeOptions& options, const std::string& input) {
    const auto start = std::chrono::steady_clock::now();
    const RowMatrix X = node_rows(light, options.turn);
    int functions = options.functions;
    if (options.max_bytes) {
        constexpr std::size_t text = 600;  // of the provenance, at most
        for (functions = max_exit_functions; functions > 4; functions -= 4)
            if (baked_bytes(light.request, functions) + text <= *options.max_bytes) break;
        if (baked_bytes(light.request, functions) + text > *options.max_bytes)
            throw Error("--max-bytes: expected at least {} for these nodes, found {}",
                        baked_bytes(light.request, 4) + text, *options.max_bytes);
    } else if (options.max_error) {
        functions = 4;
    }
    BakeResult result = bake_with(light, options, X, functions, input);
    while (options.max_error && result.errors.worst > *options.max_error) {
        if (functions == static_cast<int>(max_exit_functions))
            throw Error("--max-error: {} functions leave a worst error of {:.3g} where {:.3g} was asked for", functions,
                        result.errors.worst, *options.max_error);
        functions += 4;
        result = bake_with(light, options, X, functions, input);
    }
    result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    return result;
}

}  // namespace medulla::tables
