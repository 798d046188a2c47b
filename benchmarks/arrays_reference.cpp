// DSA-B and MGM in plain C++, one thread: the lower bound in benchmarks/arrays.py, which compiles and runs this file.
//
// arrays_reference PROTOCOL CYCLES < PROBLEM; PROBLEM consists of 32-bit integers: robots, values, edges, tables, then the
// two robots of each edge, then the tables (one for all edges, or one for each). Prints milliseconds of CPU time of the
// set-up and of the median cycle, and the costs of the first and of the best cycle. Counts no messages, checks or NCCCs.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <vector>

static double now_ms() {
    timespec time;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
    return 1e3 * time.tv_sec + 1e-6 * time.tv_nsec;
}

static uint64_t state = 1;
static double draw() {  // SplitMix64
    uint64_t z = state += 0x9E3779B97F4A7C15;
    z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9;
    z = (z ^ z >> 27) * 0x94D049BB133111EB;
    return ((z ^ z >> 31) >> 11) * 0x1p-53;
}

struct Link {
    int32_t other, table;
};

struct Problem {
    int32_t robots, values;
    std::vector<int32_t> starts, tables;
    std::vector<Link> links;
};

static std::vector<int32_t> read(size_t many) {
    std::vector<int32_t> found(many);
    if (fread(found.data(), sizeof(int32_t), many, stdin) != many) exit(1);
    return found;
}

static Problem read_problem() {
    auto head = read(4);
    Problem p{head[0], head[1], std::vector<int32_t>(head[0] + 1), {}, {}};
    auto edges = read(2 * size_t(head[2]));
    size_t size = size_t(p.values) * p.values;
    auto tables = read(head[3] * size);
    for (int32_t robot : edges) ++p.starts[robot + 1];
    for (int32_t i = 0; i < p.robots; ++i) p.starts[i + 1] += p.starts[i];
    p.links.resize(edges.size());
    auto place = p.starts;
    for (int32_t e = 0; e < head[2]; ++e) {
        int32_t table = head[3] > 1 ? 2 * e : 0, a = edges[2 * e], b = edges[2 * e + 1];
        p.links[place[a]++] = {b, table + 1};  // a row is a value of the other robot
        p.links[place[b]++] = {a, table};
    }
    p.tables.resize(2 * tables.size());
    for (int32_t t = 0; t < head[3]; ++t)
        for (int32_t i = 0; i < p.values; ++i)
            for (int32_t j = 0; j < p.values; ++j) {
                int32_t cost = tables[t * size + i * p.values + j];
                p.tables[2 * t * size + i * p.values + j] = cost;
                p.tables[(2 * t + 1) * size + j * p.values + i] = cost;
            }
    return p;
}

template <int K>
static inline void value_costs(const Problem &p, const std::vector<uint8_t> &values, int32_t robot, int32_t *costs) {
    for (int k = 0; k < K; ++k) costs[k] = 0;
    for (int32_t l = p.starts[robot]; l < p.starts[robot + 1]; ++l) {
        const int32_t *row = &p.tables[(size_t(p.links[l].table) * K + values[p.links[l].other]) * K];
        for (int k = 0; k < K; ++k) costs[k] += row[k];
    }
}

template <int K>
static int choose(const int32_t *costs, int32_t lowest, int without) {
    int found[K], many = 0;
    for (int k = 0; k < K; ++k)
        if (costs[k] == lowest && k != without) found[many++] = k;
    return many == 0 ? without : found[many == 1 ? 0 : int(draw() * many)];
}

template <int K>
static int64_t dsa(const Problem &p, std::vector<uint8_t> &values, std::vector<uint8_t> &next) {
    int64_t paid = 0;
    int32_t costs[K];
    for (int32_t i = 0; i < p.robots; ++i) {
        value_costs<K>(p, values, i, costs);
        int32_t now = costs[values[i]], lowest = *std::min_element(costs, costs + K);
        paid += now;
        next[i] = now > 0 && draw() < 0.7 ? choose<K>(costs, lowest, values[i]) : values[i];
    }
    values.swap(next);
    return paid / 2;
}

template <int K>
static int64_t mgm(
    const Problem &p, std::vector<uint8_t> &values, std::vector<uint8_t> &next, std::vector<int32_t> &gains
) {
    int64_t paid = 0;
    int32_t costs[K];
    for (int32_t i = 0; i < p.robots; ++i) {
        value_costs<K>(p, values, i, costs);
        int32_t lowest = *std::min_element(costs, costs + K);
        paid += costs[values[i]];
        gains[i] = costs[values[i]] - lowest;
        next[i] = gains[i] > 0 ? choose<K>(costs, lowest, K) : values[i];
    }
    for (int32_t i = 0; i < p.robots; ++i) {
        if (gains[i] == 0) continue;
        bool wins = true;
        for (int32_t l = p.starts[i]; wins && l < p.starts[i + 1]; ++l) {
            int32_t other = p.links[l].other;
            wins = gains[other] < gains[i] || (gains[other] == gains[i] && other > i);
        }
        if (wins) values[i] = next[i];
    }
    return paid / 2;
}

template <int K>
static void run(const Problem &p, bool is_mgm, int cycles, double setup_ms) {
    std::vector<uint8_t> values(p.robots), next(p.robots);
    std::vector<int32_t> gains(p.robots);
    std::vector<double> times;
    std::vector<int64_t> paid;
    for (auto &value : values) value = int(draw() * K);
    for (int cycle = 0; cycle < cycles; ++cycle) {
        double before = now_ms();
        paid.push_back(is_mgm ? mgm<K>(p, values, next, gains) : dsa<K>(p, values, next));
        times.push_back(now_ms() - before);
    }
    std::nth_element(times.begin(), times.begin() + cycles / 2, times.end());
    int64_t best = *std::min_element(paid.begin(), paid.end());
    printf("{\"setup_s\": %.4f, \"cycle_ms\": %.5f, \"first\": %lld, \"last\": %lld}\n", setup_ms / 1e3,
           times[cycles / 2], (long long)paid[0], (long long)best);
}

int main(int, char **words) {
    double began = now_ms();
    Problem p = read_problem();
    double setup_ms = now_ms() - began;
    bool is_mgm = !strcmp(words[1], "mgm");
    int cycles = atoi(words[2]);
    switch (p.values) {
        case 3: run<3>(p, is_mgm, cycles, setup_ms); break;
        case 5: run<5>(p, is_mgm, cycles, setup_ms); break;
        case 10: run<10>(p, is_mgm, cycles, setup_ms); break;
        default: return 2;
    }
}
