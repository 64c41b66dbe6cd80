/* The signs that the wheels dig themselves in, and their score: a sum of small monotone decision trees, fitted to simulated drives by
 * benchmarks/fit_immobilization.py (R), which wrote digging_table.h. Signs compare a signal with its own means over shorter and longer
 * times, or are in its own usual spread, so that neither the machine's size nor its usual slip matters. */
#include "digging_table.h"

#define TG_STEEPNESS ((tg_real)11.36) /* k of the prototype curve mu = A (1 - exp(-k s)) (PHYSICS 5) */
#define TG_FORCES ((tg_real)0.2)      /* s, low-pass of adhesion before its logarithm is taken */

enum { SLIP, ASYMMETRY, GRIP, ADHESION, RESISTANCE, RIM };      /* rows of tgi_signs.mean */
enum { SPREAD_SLIP, SPREAD_ASYMMETRY, SPREAD_GRIP };            /* of tgi_signs.square */

static const tg_real MEMORY[TG_MEMORIES] = {(tg_real)0.1, (tg_real)0.3, 1, 3, 20}; /* s */
#define TG_RESTARTED 3 /* the shorter memories start anew after a rest, the longer ones go on */

static tg_real low_pass(tg_real *mean, tg_real dt, tg_real tau, tg_real x)
{
    if (dt > 0) *mean += dt / (tau + dt) * (x - *mean);
    return *mean;
}

static tg_real logarithm(tg_real x, tg_real floor)
{
    return tgi_log((x > 0 ? x : 0) + floor);
}

/* Take a look; `dt` s after the one before it, of the first since a rest 0. */
void tgi_signs_take(tgi_signs *s, const tgi_view *l, tg_real dt)
{
    const tg_real force = s->seen ? dt / (TG_FORCES + dt) : 1;
    const tg_real curve = l->slip > 0 ? 1 - tgi_exp(-TG_STEEPNESS * l->slip) : 0;
    s->leading += force * (l->leading - s->leading);
    s->trailing += force * (l->trailing - s->trailing);
    s->adhesion += force * (l->adhesion - s->adhesion);
    s->curve += force * (curve - s->curve);
    const tg_real level = logarithm(s->adhesion, (tg_real)0.03);
    const tg_real now[TG_SIGNALS] = {l->slip, logarithm(s->leading, (tg_real)0.05) - logarithm(s->trailing, (tg_real)0.05),
                                     level - logarithm(s->curve, (tg_real)0.05), level, l->resistance, tgi_log(l->rim + (tg_real)0.02)};
    for (int32_t k = 0; k < TG_SIGNALS; k++)
        for (int32_t j = 0; j < TG_MEMORIES; j++) {
            if (!s->seen && (j < TG_RESTARTED || s->age == 0)) s->mean[k][j] = now[k];
            else low_pass(&s->mean[k][j], dt, j >= TG_RESTARTED && s->age < MEMORY[j] ? s->age : MEMORY[j], now[k]);
        }
    const tg_real span = s->age < 8 ? s->age : 8;
    for (int32_t k = 0; k < 3 && s->moved > 1; k++) low_pass(&s->square[k], dt, span, tgi_square(s->mean[k][1] - s->mean[k][3]));
    s->seen = 1;
    s->age += dt;
    s->moved += dt;
}

/* A rest or a gap: what the motion was is forgotten, what is usual is kept. */
void tgi_signs_rest(tgi_signs *s)
{
    s->seen = 0;
    s->moved = 0;
}

static tg_real change(const tgi_signs *s, int32_t signal, int32_t shorter, int32_t longer)
{
    return s->mean[signal][shorter] - s->mean[signal][longer];
}

/* A signal's mean over 0.3 s against its usual one, in its usual spreads. */
static tg_real unusual(const tgi_signs *s, int32_t signal, tg_real least)
{
    return change(s, signal, 1, 4) / tgi_sqrt(s->square[signal] + least * least);
}

void tgi_signs_features(const tgi_signs *s, tg_real *x)
{
    x[TG_SIGN_SLIP] = s->mean[SLIP][0];
    x[TG_SIGN_SLIP_CALM] = s->mean[SLIP][1];
    x[TG_SIGN_SLIP_RISE] = change(s, SLIP, 0, 2);
    x[TG_SIGN_SLIP_UNUSUAL] = unusual(s, SLIP, (tg_real)0.01);
    x[TG_SIGN_ASYMMETRY_CHANGE] = change(s, ASYMMETRY, 0, 2);
    x[TG_SIGN_ASYMMETRY_LEVEL] = change(s, ASYMMETRY, 2, 4);
    x[TG_SIGN_ASYMMETRY_UNUSUAL] = unusual(s, ASYMMETRY, (tg_real)0.05);
    x[TG_SIGN_GRIP_UNUSUAL] = unusual(s, GRIP, (tg_real)0.1);
    x[TG_SIGN_ADHESION_CHANGE] = change(s, ADHESION, 0, 2);
    x[TG_SIGN_ADHESION_LEVEL] = change(s, ADHESION, 1, 4);
    x[TG_SIGN_RESISTANCE_CHANGE] = change(s, RESISTANCE, 0, 2);
    x[TG_SIGN_RESISTANCE_LEVEL] = change(s, RESISTANCE, 1, 3);
    x[TG_SIGN_RIM_CHANGE] = change(s, RIM, 0, 2);
    x[TG_SIGN_RIM_LEVEL] = change(s, RIM, 1, 3);
}

/* Place of the lowest of eight bits, at least one set (Leiserson, Prokop and Randall 1998). */
static int32_t lowest(uint32_t bits)
{
    static const uint8_t place[8] = {0, 1, 2, 4, 7, 3, 6, 5};
    return place[((bits & (0u - bits)) * 0x17u >> 5) & 7u];
}

/* All trees at once, sign by sign, without a branch a split (Lucchese et al. 2015, QuickScorer). */
tg_real tg_digging_score(const tg_real *x)
{
    tg_real score = TG_DIGGING_BASE;
    uint8_t left[TG_DIGGING_TREES]; /* leaves that may yet be reached */
    memset(left, 0xff, sizeof left);
    for (int32_t s = 0; s < TG_SIGNS; s++)
        for (int32_t k = digging_first[s]; k < digging_first[s + 1] && !(x[s] <= digging_at[k]); k++) left[digging_tree[k]] &= digging_mask[k];
    for (int32_t t = 0; t < TG_DIGGING_TREES; t++) score += digging_leaf[TG_DIGGING_LEAVES * t + lowest(left[t])];
    return score;
}
