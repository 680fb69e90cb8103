// furtable: everything after the simulation.
#include "tables/programs/commands.hpp"

int main(int argc, char** argv) {
    using namespace medulla::tables;
    CLI::App app("Looks into, compresses, checks and draws tables of a fur fibre's medulla.", "furtable");
    Action action;
    add_commands(app, action);
    return run_program(app, argc, argv, [&] { action(); });
}
