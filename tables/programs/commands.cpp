#include "tables/programs/commands.hpp"

namespace medulla::tables {

void add_commands(CLI::App& app, Action& action) {
    app.set_version_flag("--version", "medulla " MEDULLA_VERSION);
    app.require_subcommand(1);
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
}

}  // namespace medulla::tables
