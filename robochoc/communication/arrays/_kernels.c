/* The cycles of dsa.py and mgm.py in C, with the same results as numpy, bit by bit. kernels.py calls these functions.
 *
 * `hatch_build.py` compiles this file into wheels with a compiled core. Each function computes the rows `from` to `to`,
 * so that threads can share the rows of a team: all costs are integers, and each robot has its own random numbers. The
 * second part of the file is compiled for each combination of integer types: it includes itself.
 */
#ifndef COST
#include <Python.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#ifdef _MSC_VER
#define EXPORT __declspec(dllexport)
#define INLINE static __forceinline
#else
#define EXPORT __attribute__((visibility("default")))
#define INLINE static inline __attribute__((always_inline))
#endif

/* The structures of kernels.py: all fields have 64 bits. */
typedef struct {
    int64_t arity;          /* the number of other robots in a scope */
    const int64_t *starts;  /* the first constraint of each robot of the group */
    const int32_t *bases;   /* the first row of each constraint's table; NULL: one table */
    const int32_t *others;  /* the rows of the other robots, constraint by constraint */
    const int64_t *strides; /* the factors of their values */
    const void *rows;       /* a row of costs for each combination of the others' values, and 3 more entries at the end */
} Block;

typedef struct {
    int64_t first, size, blocks_count;
    const Block *blocks;
    const void *fixed, *charges; /* a row of costs for each robot; NULL: no costs */
} Group;

typedef struct {
    int64_t bits; /* the number of low bits of a cost: `IntegerCosts` */
    uint64_t *states;
    const uint64_t *steps;
    const int64_t *starts, *degrees, *robots;
    const int32_t *neighbours;
} Team;

typedef struct {
    uint64_t broken, low, high;
} Sum;

typedef struct { /* of a thread: `CycleAccount` */
    int64_t bytes, largest;
    Sum sums[]; /* by arity; the first one is of fixed costs */
} Account;

enum { LANES = 4, FEW = 256, NEVER = 0, ALWAYS = 1, IN_CONFLICT = 2 };

static double draw(const Team *team, int64_t row) {
    uint64_t bits = team->states[row] += team->steps[row];
    bits = (bits ^ bits >> 30) * 0xBF58476D1CE4E5B9u;
    bits = (bits ^ bits >> 27) * 0x94D049BB133111EBu;
    return (double)((bits ^ bits >> 31) >> 11) * (1.0 / 9007199254740992.0);
}

static int64_t draw_below(const Team *team, int64_t row, int64_t many) {
    return many > 1 ? (int64_t)(draw(team, row) * (double)many) : 0;
}

static void add_to(Sum *sum, int64_t cost, int64_t bits) {
    uint64_t paid = (uint64_t)cost & (((uint64_t)1 << bits) - 1);
    sum->broken += (uint64_t)cost >> bits;
    sum->low += paid & 0xFFFFFFFFu;
    sum->high += paid >> 32;
}

static int64_t integer_bytes(int64_t number) { /* tally.py */
    if (number < 0)
        return number >= -32 ? 1 : number >= -128 ? 2 : number >= -32768 ? 3 : number >= -2147483648LL ? 5 : 9;
    return number < 128 ? 1 : number < 256 ? 2 : number < 65536 ? 3 : number < 4294967296LL ? 5 : 9;
}

static uint64_t turned(uint64_t word, int bits) { return word >> bits | word << (64 - bits); }

/* Return the first two words of the BLAKE2b digest of 16 bytes of a message with at most 128 bytes (RFC 7693). */
static void blake2b(const uint8_t *message, size_t length, uint64_t *digest) {
    static const uint64_t start[8] = {
        0x6A09E667F3BCC908u, 0xBB67AE8584CAA73Bu, 0x3C6EF372FE94F82Bu, 0xA54FF53A5F1D36F1u,
        0x510E527FADE682D1u, 0x9B05688C2B3E6C1Fu, 0x1F83D9ABFB41BD6Bu, 0x5BE0CD19137E2179u,
    };
    static const char orders[10][17] = {
        "0123456789ABCDEF", "EA489FD61C02B753", "B8C052FDAE367194", "7931DCBE265A40F8", "905724AFE1BC683D",
        "2C6A0B834D75FE19", "C51FED4A0763928B", "DB7EC13950F4862A", "6FE9B308C2D714A5", "A2847615FB9E3CD0",
    };
    static const uint8_t mixed[8][4] = {
        {0, 4, 8, 12}, {1, 5, 9, 13}, {2, 6, 10, 14}, {3, 7, 11, 15},
        {0, 5, 10, 15}, {1, 6, 11, 12}, {2, 7, 8, 13}, {3, 4, 9, 14},
    };
    uint64_t words[16] = {0}, v[16];
    for (size_t place = 0; place < length; place++) words[place / 8] |= (uint64_t)message[place] << place % 8 * 8;
    for (int place = 0; place < 16; place++) v[place] = start[place % 8];
    v[0] ^= 0x01010010;
    v[12] ^= length;
    v[14] = ~v[14];
    for (int round = 0; round < 12; round++)
        for (int step = 0; step < 8; step++) {
            const char *order = orders[round % 10] + 2 * step;
            uint64_t *a = v + mixed[step][0], *b = v + mixed[step][1], *c = v + mixed[step][2], *d = v + mixed[step][3];
            for (int half = 0; half < 2; half++) {
                *a += *b + words[order[half] < 'A' ? order[half] - '0' : order[half] - 'A' + 10];
                *d = turned(*d ^ *a, half ? 16 : 32);
                *c += *d;
                *b = turned(*b ^ *c, half ? 63 : 24);
            }
        }
    for (int place = 0; place < 2; place++) digest[place] = start[place] ^ (place ? 0 : 0x01010010) ^ v[place] ^ v[place + 8];
}

/* Compute `key_and_step` for each of `many` names, separated by zeros, after `seed`. Return 1 if a name is too long. */
EXPORT int draw_keys(
    const char *seed, int64_t seed_length, const char *names, int64_t length, uint64_t *keys, uint64_t *steps
) {
    uint8_t message[128];
    const char *end = names + length;
    if (seed_length > 128) return 1;
    memcpy(message, seed, seed_length);
    for (;; names++, keys++, steps++) {
        const char *next = memchr(names, 0, end - names);
        size_t size = (next ? next : end) - names;
        if (seed_length + size > 128) return 1;
        memcpy(message + seed_length, names, size);
        uint64_t digest[2];
        blake2b(message, seed_length + size, digest);
        *keys = digest[0];
        uint64_t step = digest[1] | 1, transitions = step ^ step >> 1;
        int many = 0;
        for (; transitions; transitions &= transitions - 1) many++;
        *steps = many < 24 ? step ^ 0xAAAAAAAAAAAAAAAAu : step;
        names += size;
        if (names == end) return 0;
    }
}

/* Sort numbers of 0 or more, and return in `order` where they were: radix sort. The other arrays are work space. */
EXPORT int sort_order(int64_t *numbers, int64_t *order, int64_t *numbers_after, int64_t *order_after, int64_t many) {
    enum { BITS = 11, DIGITS = 1 << BITS };
    int64_t largest = 0;
    for (int64_t one = 0; one < many; one++) {
        order[one] = one;
        largest = numbers[one] > largest ? numbers[one] : largest;
    }
    int passes = 0;
    for (int shift = 0; shift < 63 && (largest >> shift || passes % 2); shift += BITS, passes++) {
        int64_t places[DIGITS + 1] = {0};
        for (int64_t one = 0; one < many; one++) places[(numbers[one] >> shift & (DIGITS - 1)) + 1]++;
        for (int digit = 0; digit < DIGITS; digit++) places[digit + 1] += places[digit];
        for (int64_t one = 0; one < many; one++) {
            int64_t place = places[numbers[one] >> shift & (DIGITS - 1)]++;
            numbers_after[place] = numbers[one];
            order_after[place] = order[one];
        }
        int64_t *swap = numbers;
        numbers = numbers_after, numbers_after = swap;
        swap = order, order = order_after, order_after = swap;
    }
    return passes % 2;
}

static struct PyModuleDef module = {PyModuleDef_HEAD_INIT, "_kernels", NULL, -1, NULL, NULL, NULL, NULL, NULL};
PyMODINIT_FUNC PyInit__kernels(void) { return PyModule_Create(&module); }

#define JOINED(name, cost, value) name##_##cost##_##value
#define NAMED(name, cost, value) JOINED(name, cost, value)
#define OF(name) NAMED(name, COST, VALUE)
#define FOR_LANES(function, ...) \
    if (group->size <= LANES) return OF(function)(__VA_ARGS__, LANES); \
    if (group->size <= 2 * LANES) return OF(function)(__VA_ARGS__, 2 * LANES); \
    return OF(function)(__VA_ARGS__, (group->size + LANES - 1) / LANES * LANES)

#define COST int32_t
#define VALUE int8_t
#include "_kernels.c"
#define VALUE int16_t
#include "_kernels.c"
#undef COST
#define COST int64_t
#define VALUE int8_t
#include "_kernels.c"
#define VALUE int16_t
#include "_kernels.c"

#else

/* Compute the costs of all values of one robot, and add the cost of its value to `sums`. Up to three more entries are
 * added up, and not used. Constant `lanes` make loops fast. */
INLINE void OF(add_up)(
    const Team *team, const Group *group, const VALUE *values, int64_t row, COST *total, Sum *sums, int64_t lanes
) {
    int64_t size = group->size, own = values[group->first + row];
    for (int64_t value = 0; value < lanes; value++) total[value] = 0;
    if (group->fixed)
        for (int64_t value = 0; value < size; value++) total[value] = ((const COST *)group->fixed)[row * size + value];
    COST before = total[own];
    if (group->fixed) add_to(sums, before, team->bits);
    for (const Block *block = group->blocks; block < group->blocks + group->blocks_count; block++) {
        const COST *rows = block->rows;
        for (int64_t one = block->starts[row]; one < block->starts[row + 1]; one++) {
            int64_t place = block->bases ? block->bases[one] : 0;
            if (block->arity == 1) place += values[block->others[one]];
            else
                for (int64_t axis = 0; axis < block->arity; axis++)
                    place += values[block->others[one * block->arity + axis]] * block->strides[axis];
            const COST *costs = rows + place * size;
            for (int64_t value = 0; value < lanes; value += LANES)
                for (int lane = 0; lane < LANES; lane++) total[value + lane] += costs[value + lane];
        }
        add_to(sums + block->arity, total[own] - before, team->bits);
        before = total[own];
    }
}

INLINE int64_t OF(cheapest)(const COST *total, int64_t size, COST *lowest) {
    int64_t many = 0;
    *lowest = total[0];
    for (int64_t value = 1; value < size; value++) *lowest = total[value] < *lowest ? total[value] : *lowest;
    for (int64_t value = 0; value < size; value++) many += total[value] == *lowest;
    return many;
}

/* Return the value with this number among the cheapest ones, without `own`. */
INLINE VALUE OF(nth)(const COST *total, COST lowest, int64_t own, int64_t number) {
    int64_t value = 0;
    while (total[value] != lowest || value == own || number-- > 0) value++;
    return (VALUE)value;
}

INLINE COST *OF(space)(int64_t size, COST *few) {
    return size <= FEW - LANES ? few : malloc((size + LANES) * sizeof(COST));
}

/* `CycleRun.value_costs` */
INLINE int OF(value_costs_rows)(
    const Team *team, const Group *group, const VALUE *values, COST *found, Account *account, int64_t from, int64_t to, int64_t lanes
) {
    COST few[FEW], *total = OF(space)(group->size, few);
    if (!total) return 1;
    for (int64_t row = from; row < to; row++) {
        OF(add_up)(team, group, values, row, total, account->sums, lanes);
        memcpy(found + row * group->size, total, group->size * sizeof(COST));
    }
    if (total != few) free(total);
    return 0;
}

EXPORT int OF(value_costs)(
    const Team *team, const Group *group, const VALUE *values, COST *found, Account *account, int64_t from, int64_t to
) {
    FOR_LANES(value_costs_rows, team, group, values, found, account, from, to);
}

/* `ArrayDSA._choose` */
INLINE int OF(dsa_rows)(
    const Team *team, const Group *group, const VALUE *values, VALUE *next, int64_t sideways, double probability,
    double probability_of_gain, Account *account, int64_t from, int64_t to, int64_t lanes
) {
    COST few[FEW], *total = OF(space)(group->size, few), lowest;
    if (!total) return 1;
    for (int64_t row = from; row < to; row++) {
        OF(add_up)(team, group, values, row, total, account->sums, lanes);
        int64_t place = group->first + row, own = values[place];
        int64_t others = OF(cheapest)(total, group->size, &lowest);
        int gains = total[own] > lowest;
        others -= !gains;
        next[place] = (VALUE)own;
        if (!others || !(gains || sideways)) continue;
        if (!gains && sideways == IN_CONFLICT) {
            COST alone = group->charges ? ((const COST *)group->charges)[row * group->size + own] : 0;
            if (total[own] == alone) continue;
        }
        if (draw(team, place) < (gains ? probability_of_gain : probability))
            next[place] = OF(nth)(total, lowest, own, draw_below(team, place, others));
    }
    if (total != few) free(total);
    return 0;
}

EXPORT int OF(dsa)(
    const Team *team, const Group *group, const VALUE *values, VALUE *next, int64_t sideways, double probability,
    double probability_of_gain, Account *account, int64_t from, int64_t to
) {
    FOR_LANES(dsa_rows, team, group, values, next, sideways, probability, probability_of_gain, account, from, to);
}

/* `ArrayGainers.best_unilateral`, and the sizes of the messages with the gains: `rest` bytes and two numbers */
INLINE int OF(best_unilateral_rows)(
    const Team *team, const Group *group, const VALUE *values, VALUE *targets, COST *gains, int64_t rest,
    Account *account, int64_t from, int64_t to, int64_t lanes
) {
    COST few[FEW], *total = OF(space)(group->size, few), lowest;
    if (!total) return 1;
    for (int64_t row = from; row < to; row++) {
        OF(add_up)(team, group, values, row, total, account->sums, lanes);
        int64_t place = group->first + row, own = values[place];
        int64_t many = OF(cheapest)(total, group->size, &lowest);
        int64_t gain = total[own] - lowest, broken = (gain + ((int64_t)1 << team->bits >> 1)) >> team->bits;
        int64_t bytes = rest + integer_bytes(broken) + integer_bytes(gain - (broken << team->bits));
        gains[place] = (COST)gain;
        targets[place] = gain ? OF(nth)(total, lowest, -1, draw_below(team, place, many)) : (VALUE)own;
        account->bytes += bytes * team->degrees[place];
        account->largest = bytes > account->largest ? bytes : account->largest;
    }
    if (total != few) free(total);
    return 0;
}

EXPORT int OF(best_unilateral)(
    const Team *team, const Group *group, const VALUE *values, VALUE *targets, COST *gains, int64_t rest,
    Account *account, int64_t from, int64_t to
) {
    FOR_LANES(best_unilateral_rows, team, group, values, targets, gains, rest, account, from, to);
}

/* Move the robots that gain most: `ArrayGainers.wins`. */
EXPORT int OF(move_winners)(
    const Team *team, VALUE *values, const VALUE *targets, const COST *gains, Account *account, int64_t from, int64_t to
) {
    (void)account;
    for (int64_t row = from; row < to; row++) {
        if (gains[row] <= 0) continue;
        const int32_t *one = team->neighbours + team->starts[row], *end = one + team->degrees[row];
        while (one < end && gains[*one] + (team->robots[*one] < team->robots[row]) <= gains[row]) one++;
        if (one == end) values[row] = targets[row];
    }
    return 0;
}

#undef VALUE
#endif
