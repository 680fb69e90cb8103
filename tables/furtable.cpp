// furtable: everything after the simulation.
#include "tables/commands.hpp"

int main(int argc, char** argv) {
    using namespace medulla::tables;
    CLI::App app("Looks into, compresses, checks and draws tables of a fur fibre's medulla.", "furtable");
    app.set_version_flag("--version", "medulla " MEDULLA_VERSION);
    app.require_subcommand(1);
    Action action;
    add_info(app, action);
    add_compress(app, action);
    add_query(app, action);
    add_verify(app, action);
    add_diff(app, action);
    add_merge(app, action);
    add_plot(app, action);
    add_export(app, action);
    add_bcsdf(app, action);
    add_presets(app, action);
    return run_program(app, argc, argv, [&] { action(); });
}
