// The subcommands of furtable: each adds its words to the program and sets `action` when it is the one that was typed.
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

/// The rows of a LobeError that compress, diff and verify print alike.
nlohmann::ordered_json to_json(const std::vector<LobeError>& errors);
void print(const std::vector<LobeError>& errors);
nlohmann::ordered_json to_json(const PackDegeneracy& degeneracy);
void print(const PackDegeneracy& degeneracy);

/// A subcommand whose words live in T: declares it, and runs `run(words)` when it is typed.
template <class T, class Declare, class Run>
void add_command(CLI::App& app, Action& action, const char* name, const char* help, Declare declare, Run run) {
    auto words = std::make_shared<T>();
    CLI::App* command = app.add_subcommand(name, help);
    declare(*command, *words);
    command->callback([&action, words, run] { action = [words, run] { run(*words); }; });
}

}  // namespace medulla::tables
