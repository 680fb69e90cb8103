// Interleaved timing of rows that do the same job: short blocks by turns, so that what disturbs the machine meets all
// of them alike; minimum and median a row.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <functional>
#include <string>
#include <vector>

namespace medulla::bench {

class VertexTimes {
  public:
    /// @param items how many hits there are to draw blocks from
    explicit VertexTimes(int items) : items_(items) {}

    /// @param vertex what one hit costs; its result is summed, so that no part of it can be left out
    /// @param error relative L2 error of the values; negative: none to state
    template <class Vertex>
    void add(const std::string& name, Vertex vertex, double error = -1) {
        add_block(
            name, block_size,
            [vertex](int first, int count) {
                float sum = 0;
                for (int i = first; i < first + count; ++i) sum += vertex(i);
                return sum;
            },
            error);
    }
    /// The same of a row that does `count` hits at once, a divisor of `items`. @param block (first, count) -> sum
    void add_block(const std::string& name, int count, std::function<float(int, int)> block, double error = -1) {
        rows_.push_back({name, error, count, std::move(block), {}});
    }

    void run(double seconds) {
        using Clock = std::chrono::steady_clock;
        const auto end = Clock::now() + std::chrono::duration<double>(seconds);
        for (int turn = 0; turn < least_turns || Clock::now() < end; ++turn)
            for (Row& row : rows_) {
                const int first = turn * row.count % items_;
                const auto start = Clock::now();
                sink_ = row.block(first, row.count);
                const std::chrono::duration<double, std::nano> took = Clock::now() - start;
                row.times.push_back(took.count() / row.count);
            }
        for (Row& row : rows_) std::sort(row.times.begin(), row.times.end());
    }

    void print_table() const {
        std::printf("%-24s %9s %9s %7s %9s\n", "path vertex", "ns, least", "median", "ratio", "error");
        for (const Row& row : rows_) {
            std::printf("%-24s %9.1f %9.1f %7.2f", row.name.c_str(), least(row), median(row), ratio(row));
            if (row.error >= 0)
                std::printf(" %9.1e\n", row.error);
            else
                std::printf(" %9s\n", "-");
        }
        std::printf("%zu blocks a row; ratio of the least times to the last row\n%s, %s\n", rows_[0].times.size(),
                    machine().c_str(), compiler());
    }

    /// The members of a JSON object, without its braces.
    void print_json() const {
        std::printf("\"rows\": [\n");
        for (const Row& row : rows_) {
            std::printf("  {\"name\": \"%s\", \"ns\": %.5g, \"ratio\": %.4g, \"median_ns\": %.5g", row.name.c_str(),
                        least(row), ratio(row), median(row));
            if (row.error >= 0) std::printf(", \"error\": %.3g", row.error);
            std::printf("}%s\n", &row == &rows_.back() ? "" : ",");
        }
        std::printf("], \"machine\": \"%s\", \"compiler\": \"%s\"", machine().c_str(), compiler());
    }

  private:
    struct Row {
        std::string name;
        double error;
        int count;
        std::function<float(int, int)> block;
        std::vector<double> times;  ///< [ns / hit]
    };
    static constexpr int block_size = 128, least_turns = 9;

    static double least(const Row& row) { return row.times.front(); }
    static double median(const Row& row) { return row.times[row.times.size() / 2]; }
    double ratio(const Row& row) const { return least(row) / least(rows_.back()); }

    static std::string machine() {
        std::ifstream in("/proc/cpuinfo");
        for (std::string line; std::getline(in, line);)
            if (line.compare(0, 10, "model name") == 0) {
                std::string name = line.substr(std::min(line.size(), line.find(':') + 2));
                name.erase(std::remove_if(name.begin(), name.end(), [](char c) { return c == '"' || c == '\\'; }),
                           name.end());
                return name;
            }
        return "unknown";
    }
    static const char* compiler() {
#if defined(__clang__)
        return "clang " __clang_version__;
#elif defined(__GNUC__)
        return "g++ " __VERSION__;
#else
        return "unknown";
#endif
    }

    int items_;
    std::vector<Row> rows_;
    volatile float sink_ = 0;
};

}  // namespace medulla::bench
