/* Fuzzy supervisor of physics.md 6 (a reconstruction): gamma from how much the signals changed over a window. Zero-order Sugeno, 3 by 3.
 *
 * Snapshots, a fiftieth of the window apart, hold the last known values. The reference is the newest snapshot at least a window old, else
 * the oldest; means are over what is younger than it, the present included. A value not known yet has not changed. */
#include "filter.h"

#define APART 50              /* snapshots a window */
#define CLOCK_TOLERANCE 1e-6  /* s: a sum of dt, in single precision too, is no exact multiple of the window */

static const tg_real RULES[3][3] = { /* rows: wheel speeds small, medium, large; columns: ground speed */
    {(tg_real)0.1, (tg_real)0.4, (tg_real)0.8},
    {(tg_real)0.4, (tg_real)0.6, (tg_real)0.9},
    {(tg_real)0.8, (tg_real)0.9, (tg_real)1.0}};

void tgi_supervisor_init(tg_filter *f)
{
    for (int i = 0; i <= f->wheels; i++) f->policy.adaptive.supervisor.last[i] = (tg_real)NAN;
    f->policy.adaptive.supervisor.gamma = RULES[0][0];
}

static tg_real clip(tg_real x) { return x < 0 ? 0 : x > 1 ? 1 : x; }

static void memberships(tg_real change, tg_real *m)
{
    m[0] = clip(((tg_real)0.06 - change) / (tg_real)0.04);
    m[2] = clip((change - (tg_real)0.10) / (tg_real)0.10);
    m[1] = 1 - m[0] - m[2];
}

/* Mean slip (paper eq. 4) of the wheels where it is defined, else NaN. */
static tg_real mean_slip(const tg_filter *f, const tg_real *omega, tg_real v)
{
    tg_real sum = 0;
    int count = 0;
    for (int i = 0; i < f->wheels; i++) {
        const tg_real rolling = f->machine.radius[i] * tgi_fabs(omega[i]), ground = tgi_fabs(v);
        const int still = tgi_fabs(omega[i]) < f->tuning.wheel_speed_min && ground < f->tuning.ground_speed_min;
        if (still || !(rolling == rolling) || !(ground == ground)) continue;
        sum += ground <= rolling ? 1 - ground / rolling : rolling / ground - 1;
        count++;
    }
    return count ? sum / (tg_real)count : (tg_real)NAN;
}

/* Last known omega and v, this instant's included. */
static void known_values(const tg_filter *f, const tgi_plan *plan, tg_real *known)
{
    for (int i = 0; i <= f->wheels; i++) known[i] = f->policy.adaptive.supervisor.last[i];
    for (int o = 0; plan->count && o <= f->wheels; o++)
        if (plan->present[o]) known[tgi_channel(f->wheels, o)] = plan->y[o];
}

static void watched_values(const tg_filter *f, const tg_real *known, const tg_input *now, tg_real *value)
{
    const int n = f->wheels;
    for (int i = 0; i <= n; i++) value[i] = known[i];
    if (f->tuning.supervisor == 0) return;
    for (int i = 0; i < n; i++) value[i] = now->torque[i];
    value[n] = mean_slip(f, known, known[n]);
}

/* Place among the snapshots, oldest first, of the newest one a window old at time t; else of the oldest. */
static int reference(const tg_filter *f, double t)
{
    const tg_supervisor_state *const s = &f->policy.adaptive.supervisor;
    int found = 0;
    while (found + 1 < s->count && s->time[(s->first + found + 1) % TG_SNAPSHOTS] <= t - (double)f->tuning.window + CLOCK_TOLERANCE) found++;
    return found;
}

/* The mean of |value| under which a change is no longer measured by it. */
static tg_real floor_of(const tg_filter *f, int i)
{
    const int n = f->wheels;
    if (f->tuning.supervisor == 0) return i < n ? f->tuning.wheel_speed_min : f->tuning.ground_speed_min;
    return f->machine.radius[i] * f->machine.mass * f->machine.gravity * (tg_real)0.02 / (tg_real)n;
}

tg_real tgi_supervise(const tg_filter *f, const tgi_plan *plan, const tg_input *now)
{
    const tg_supervisor_state *const s = &f->policy.adaptive.supervisor;
    const int n = f->wheels;
    tg_real known[TG_MAX_WHEELS + 1], value[TG_MAX_WHEELS + 1], change[2] = {0, 0}, m[2][3];
    known_values(f, plan, known);
    watched_values(f, known, now, value);
    if (s->count) {
        const int at = reference(f, f->clock + (double)plan->passage.dt);
        const tg_real *const then = s->value[(s->first + at) % TG_SNAPSHOTS];
        tg_real sum[TG_MAX_WHEELS + 1];
        for (int i = 0; i <= n; i++) sum[i] = tgi_fabs(value[i]);
        for (int k = at + 1; k < s->count; k++) {
            const tg_real *const between = s->value[(s->first + k) % TG_SNAPSHOTS];
            for (int i = 0; i <= n; i++) sum[i] += tgi_fabs(between[i]);
        }
        for (int i = 0; i <= n; i++) {
            const tg_real moved = tgi_fabs(value[i] - then[i]), mean = sum[i] / (tg_real)(s->count - at);
            const tg_real scale = f->tuning.supervisor && i == n ? (tg_real)0.25 : mean > floor_of(f, i) ? mean : floor_of(f, i);
            const tg_real ratio = moved / scale;
            if (ratio > change[i == n]) change[i == n] = ratio; /* NaN: not known then or now */
        }
    }
    memberships(change[0], m[0]);
    memberships(change[1], m[1]);
    tg_real gamma = 0;
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) gamma += m[0][i] * m[1][j] * RULES[i][j]; /* the products sum to 1 */
    return gamma;
}

void tgi_supervisor_remember(tg_filter *f, const tgi_plan *plan, const tg_input *now)
{
    tg_supervisor_state *const s = &f->policy.adaptive.supervisor;
    const double t = f->clock + (double)plan->passage.dt, apart = (double)f->tuning.window / APART;
    tg_real known[TG_MAX_WHEELS + 1];
    known_values(f, plan, known);
    s->gamma = plan->gamma;
    for (int i = 0; i <= f->wheels; i++) s->last[i] = known[i];
    if (s->count && t - s->time[(s->first + s->count - 1) % TG_SNAPSHOTS] < apart - CLOCK_TOLERANCE) return;
    int gone = s->count ? reference(f, t) : 0; /* older than any reference to come */
    if (s->count - gone == TG_SNAPSHOTS) gone++;
    s->first = (s->first + gone) % TG_SNAPSHOTS;
    s->count -= gone;
    const int place = (s->first + s->count++) % TG_SNAPSHOTS;
    s->time[place] = t;
    watched_values(f, known, now, s->value[place]);
}
