// The subcommands of furtable: each declares its options and sets `action` when it is selected.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>

#include "tables/pack/degeneracy.hpp"
#include "tables/pack/source.hpp"
#include "tables/programs/program.hpp"

namespace medulla::tables {

using Action = std::function<void()>;

void add_info(CLI::App& app, Action& action);
void add_merge(CLI::App& app, Action& action);
void add_compress(CLI::App& app, Action& action);
void add_query(CLI::App& app, Action& action);
void add_verify(CLI::App& app, Action& action);
void add_diff(CLI::App& app, Action& action);
void add_plot(CLI::App& app, Action& action);
void add_export(CLI::App& app, Action& action);
void add_bcsdf(CLI::App& app, Action& action);
void add_presets(CLI::App& app, Action& action);

/// All of them.
void add_commands(CLI::App& app, Action& action);

/// Output shared by compress, diff and verify.
nlohmann::ordered_json to_json(const std::vector<LobeError>& errors);
void print(const std::vector<LobeError>& errors);
nlohmann::ordered_json to_json(const PackDegeneracy& degeneracy);
void print(const PackDegeneracy& degeneracy);

/// A subcommand with its arguments in T: declares it, and calls `run(args)` when it is selected.
template <class T, class Declare, class Run>
void add_command(CLI::App& app, Action& action, const char* name, const char* help, Declare declare, Run run) {
    auto args = std::make_shared<T>();
    CLI::App* command = app.add_subcommand(name, help);
    declare(*command, *args);
    command->callback([&action, args, run] { action = [args, run] { run(*args); }; });
}

}  // namespace medulla::tables
