#include "tables/programs/program.hpp"

#include <new>
#include <sstream>

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

/// An empty word, also as `--option=`, is no value of any option: CLI11 2.1 never ends on some short options after one,
/// and takes the second for an option that was not given.
void refuse_empty_words(int argc, char** argv) {
    for (int i = 1; i < argc; ++i) {
        const std::string word = argv[i], before = i > 1 ? argv[i - 1] : "";
        const bool option = before.size() > 1 && before[0] == '-' && before.find('=') == std::string::npos;
        if (word.empty())
            throw UsageError("{}expected no empty word, found one as number {}", option ? before + ": " : "", i);
        if (word.rfind("--", 0) == 0 && word.size() > 3 && word.find('=') == word.size() - 1)
            throw UsageError("{}: expected a value, found none", word.substr(0, word.size() - 1));
    }
}

int run_action(CLI::App& app, int argc, char** argv, const std::function<void()>& action) {
    const auto complain = [&](const std::string& text) { say(app.get_name(), text); };
    try {
        refuse_empty_words(argc, argv);
        app.parse(argc, argv);
        action();
        return 0;
    } catch (const CLI::Success& help) {
        std::ostringstream text;
        const int status = app.exit(help, text, text);
        print_text(text.str());
        return status;
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

}  // namespace

std::string one_line(std::string text) {
    for (char& c : text)
        if (static_cast<unsigned char>(c) < ' ' || c == 127) c = '?';
    return text;
}

void say(const std::string& program, const std::string& text) { note("{}: {}\n", program, one_line(text)); }

std::string counted(std::size_t count, const std::string& thing) {
    return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
}

int run_program(CLI::App& app, int argc, char** argv, const std::function<void()>& action) {
    guard_streams();
    const int status = run_action(app, argc, argv, action);
    try {
        flush_output();
    } catch (const Error& error) {
        say(app.get_name(), error.what());
        return status == 0 ? 1 : status;
    }
    return status;
}

}  // namespace medulla::tables
