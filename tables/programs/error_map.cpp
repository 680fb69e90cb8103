#include "tables/programs/error_map.hpp"

#include <omp.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <vector>

#include "tables/error.hpp"
#include "tables/job/simulate.hpp"
#include "tables/programs/bake.hpp"
#include "tables/programs/program.hpp"
#include "tables/store/json_text.hpp"
#include "tables/store/output.hpp"
#include "tables/streams.hpp"

namespace medulla::tables {
namespace {

constexpr double degrees = 180 / pi;

/// Throws Error for a material outside the limits of the simulation.
Material mapped_material(const std::string& fibre, bool& is_preset) {
    Material material = fibre_named(fibre, is_preset);
    const FurParameters<3>& p = material.fur;
    const auto within = [&](const char* field, double found, double low, double high) {
        if (!(found > low && found < high))
            throw Error("{}: /{}: expected degrees in ({:g}, {:g}) for --error-map, found {:g}", fibre, field, low,
                        high, found);
    };
    within("alpha", double(p.alpha) * degrees, -45, 45);
    within("beta_m", double(p.beta_m) * degrees, 0, 114.5);
    within("beta_n", double(p.beta_n) * degrees, 0, 114.5);
    const double sine = std::cos(pi / double(sim3d::ErrorMapOptions{}.inclinations + 1)) / double(p.eta);  // steepest
    const double radius = double(p.sigma_ms) * double(p.kappa) / std::sqrt((1 - sine) * (1 + sine));
    if (!(radius <= greatest_grid_sigma))
        throw Error(
            "{}: /sigma_ms: expected an optical radius sigma_ms kappa / cos theta_t of at most {:g} for "
            "--error-map, found {:.3g}",
            fibre, greatest_grid_sigma, radius);
    return material;
}

/// In its lifetime SIGINT and SIGTERM end the process with a message: until the page is written there is nothing to
/// keep.
class EndedBySignals {
  public:
    EndedBySignals() {
        struct sigaction action = {};
        action.sa_handler = [](int number) {
            constexpr char text[] = "medulla-precompute: interrupted: no page written\n";
            message(STDERR_FILENO, text, sizeof text - 1);
            ::_exit(128 + number);
        };
        ::sigaction(SIGINT, &action, &old_[0]);
        ::sigaction(SIGTERM, &action, &old_[1]);
    }
    ~EndedBySignals() {
        ::sigaction(SIGINT, &old_[0], nullptr);
        ::sigaction(SIGTERM, &old_[1], nullptr);
    }
    EndedBySignals(const EndedBySignals&) = delete;
    EndedBySignals& operator=(const EndedBySignals&) = delete;

  private:
    struct sigaction old_[2];
};

}  // namespace

void run_error_map(const ErrorMapArguments& args) {
    bool is_preset = false;
    ErrorMapTitle title{mapped_material(args.fibre, is_preset), args.paths, args.seed};
    const Output output(args.output, is_preset ? std::vector<std::string>{} : std::vector<std::string>{args.fibre});
    if (args.threads > 0) omp_set_num_threads(args.threads);
    const auto start = std::chrono::steady_clock::now();
    sim3d::ErrorMapOptions options;
    options.paths = args.paths, options.seed = args.seed;
    sim3d::ErrorMap map;
    {
        const EndedBySignals signals;
        Progress progress(args.progress, "error map", sim3d::map_cells(options));
        options.progress = [&] { progress.add(1); };
        const FurParameters<3>& fur = title.material.fur;
        map = sim3d::error_map(sim3d::fibre_of(fur, title.channels()), sim3d::form_of(fur), options);
    }
    output.write(error_map_page(title, map));
    if (args.json) return print("{}\n", json_line(error_map_json(title, map)));
    print_messages();
    for (std::size_t c = 0; c < title.channels(); ++c) {
        const sim3d::ChannelError& e = map.all.channels[c];
        if (!e.lobe.defined) {
            print("{}: R {:.4f} +- {:.4f}, model {:.4f}; next to no scattered light\n", title.channel(c),
                  e.truth[0].value, e.truth[0].error, e.model[0]);
            continue;
        }
        print(
            "{}: scattered {:.4f} +- {:.4f}, model {:.4f}; relative L2 error of the scattered lobe {:.3f}, of its "
            "shape {:.3f}, with cos theta_r {:.3f}\n",
            title.channel(c), e.scattered.value, e.scattered.error, e.model_scattered(), e.lobe.value(),
            e.shape.value(), e.cosine.value());
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    print("{} written in {}\n", args.output, duration_text(seconds));
}

}  // namespace medulla::tables
