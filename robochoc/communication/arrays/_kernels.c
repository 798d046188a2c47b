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
