#include "tables/programs/program.hpp"

#include <cstdio>
#include <new>

namespace medulla::tables {

namespace {

/// What CLI11 says of wrong words; of a command that there is not it says only that one is required.
std::string what_is_wrong(const CLI::App& app, const CLI::ParseError& error, int argc, char** argv) {
    const auto commands = app.get_subcommands([](const CLI::App*) { return true; });
    if (commands.empty() || !app.get_subcommands().empty()) return error.what();
    std::string names;
    for (const CLI::App* command : commands) names += (names.empty() ? "" : ", ") + command->get_name();
    return fmt::format("expected a command ({}), found {}", names,
                       argc > 1 ? fmt::format("'{}'", argv[1]) : std::string("none"));
}

}  // namespace

void say(const std::string& program, std::string text) {
    for (char& c : text)
        if (static_cast<unsigned char>(c) < ' ' || c == 127) c = '?';
    fmt::print(stderr, "{}: {}\n", program, text);
    std::fflush(stderr);
}

std::string counted(std::size_t count, const std::string& thing) {
    return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
}

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action) {
    const auto complain = [&](const std::string& text) { say(app.get_name(), text); };
    try {
        // CLI11 2.1 never ends on some short options after an empty word, which none of ours can be.
        for (int i = 1; i < argc; ++i)
            if (argv[i][0] == '\0') throw UsageError("expected no empty word, found one as number {}", i);
        app.parse(argc, argv);
        action();
        if (std::fflush(stdout) != 0) throw Error("standard output: cannot be written");
        return 0;
    } catch (const CLI::Success& help) {
        return app.exit(help);
    } catch (const CLI::ParseError& error) {
        complain(what_is_wrong(app, error, argc, argv));
        return 2;
    } catch (const UsageError& error) {
        complain(error.what());
        return 2;
    } catch (const Interrupted& interrupted) {
        complain(interrupted.what());
        return 128 + interrupted.signal;
    } catch (const Reported&) {
    } catch (const std::bad_alloc&) {
        complain("not enough memory");
    } catch (const std::exception& error) {
        complain(error.what());
    }
    return 1;
}

}  // namespace medulla::tables
