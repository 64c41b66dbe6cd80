/* One step worked out from its arguments alone: is it sound, what map of the state is it, which channels are there. Inlined, so that the
 * wheel count is a constant. */
#ifndef TG_PLAN_H
#define TG_PLAN_H
#include "filter.h"

typedef struct {
    tg_real dt;
    const tg_input *before, *now;
    const tg_real *q_input, *y, *r; /* q_input may be null: none. y null: predict only */
} tgi_call;

/* Cosine and sine of a slope, remembered for the two last ones: most steps repeat them. */
TG_INLINE void plan_slope(const tg_filter *f, tg_real slope, tg_real *cosine, tg_real *sine)
{
    for (int i = 0; i < 2; i++)
        if (slope == f->slope[i]) {
            *cosine = f->cosine[i];
            *sine = f->sine[i];
            return;
        }
    *cosine = tgi_cos(slope);
    *sine = tgi_sin(slope);
}

TG_INLINE tg_status plan_check_input(const tg_input *u, const int n)
{
    tg_real zero = u->drawbar * 0 + u->slope * 0 + u->mass * 0 + u->hitch_load * 0;
    for (int i = 0; i < n; i++) zero += u->torque[i] * 0 + u->load[i] * 0;
    if (zero != 0) return TG_NOT_FINITE; /* NaN, from an infinite or NaN term */
    for (int i = 0; i < n; i++)
        if (!(u->load[i] > 0)) return TG_NOT_POSITIVE;
    return u->mass < 0 ? TG_NOT_POSITIVE : TG_OK;
}

/* The one-step map (paper eq. 2 and 3): the closed form of Runge-Kutta 4 on physics.md 1, which is affine, in equal substeps of at most
 * TG_SUBSTEP/stiffness. */
TG_INLINE tg_status plan_passage(const tg_filter *f, const tg_input *u, tg_real dt, tgi_plan *plan, const int n)
{
    tg_passage *const p = &plan->passage;
    tg_real longest = 1;
    for (int i = 0; i < n; i++)
        if (f->moves[i] > longest) longest = f->moves[i];
    const tg_real stretch = f->stiffness * longest * dt / TG_SUBSTEP;
    if (!(stretch <= TG_SUBSTEPS_MAX)) return TG_BAD_ARGUMENT;
    for (int i = 0; i < TG_MAX_WHEELS; i += TG_LANES) { /* places beyond the last wheel stay 0 */
        lanes_store(p->phi + i, lanes_all(0));
        lanes_store(p->psi + i, lanes_all(0));
        lanes_store(p->b + i, lanes_all(0));
        lanes_store(p->c + i, lanes_all(0));
    }
    plan->substeps = stretch > 1 ? (int32_t)tgi_ceil(stretch) : 1;
    const tg_real h = plan->substeps == 1 ? dt : dt / (tg_real)plan->substeps;
    for (int i = 0; i < n; i++) {
        const tg_real moved = f->moves[i] * h, z = -f->drag[i] * moved;
        p->phi[i] = 1 + z * (1 + z * ((tg_real)1 / 2 + z * ((tg_real)1 / 6 + z * ((tg_real)1 / 24))));
        p->psi[i] = moved * (1 + z * ((tg_real)1 / 2 + z * ((tg_real)1 / 6 + z * ((tg_real)1 / 24))));
    }
    if (plan->substeps > 1)
        for (int i = 0; i < n; i++) { /* the map, `substeps` times, by squaring */
            tg_real phi = p->phi[i], psi = p->psi[i], whole_phi = 1, whole_psi = 0;
            for (int32_t left = plan->substeps; left; left >>= 1) {
                if (left & 1) {
                    whole_psi = phi * whole_psi + psi;
                    whole_phi *= phi;
                }
                psi += phi * psi;
                phi *= phi;
            }
            p->phi[i] = whole_phi;
            p->psi[i] = whole_psi;
        }
    plan_slope(f, u->slope, &plan->cosine[0], &plan->sine[0]);
    const tg_real per_mass = dt * tgi_inverse_mass(f, u), g = f->machine.gravity * dt;
    p->dt = dt;
    p->keep = 1;
    p->g = g * plan->cosine[0] + per_mass * u->hitch_load;
    for (int j = 0; j < TG_ROWS; j += TG_LANES) lanes_store(plan->shift + j, lanes_all(0));
    plan->shift[n + 1] = -per_mass * u->drawbar - g * plan->sine[0];
    for (int i = 0; i < n; i++) {
        const tg_real pull = f->arm[i] * u->load[i];
        p->b[i] = -p->psi[i] * pull;
        p->c[i] = per_mass * u->load[i];
        plan->shift[n + 2 + i] = p->psi[i] * (u->torque[i] * f->inverse_inertia[i] - f->machine.tire_rolling_resistance * pull);
    }
    return TG_OK;
}

/* Which channels are there; the row of H of a_x with the inputs of its instant (physics.md 1). */
TG_INLINE tg_status plan_channels(const tg_filter *f, const tgi_call *call, tgi_plan *plan, const int n)
{
    tg_real zero = 0;
    int count = 0, positive = 1;
    for (int o = 0; o < n + 2; o++) {
        const tg_real y = call->y[tgi_channel(n, o)], r = call->r[tgi_channel(n, o)];
        plan->present[o] = y == y;
        plan->y[o] = y;
        plan->r[o] = r;
        if (!plan->present[o]) continue;
        count++;
        zero += y * 0 + r * 0;
        positive &= r > 0;
    }
    if (zero != 0) return TG_NOT_FINITE;
    if (!positive) return TG_NOT_POSITIVE;
    plan->count = count;
    plan->accelerometer_shift = 0;
    for (int i = 0; i <= n; i++) plan->accelerometer[i] = 0;
    if (call->y[n + 1] != call->y[n + 1]) return TG_OK;
    plan_slope(f, call->now->slope, &plan->cosine[1], &plan->sine[1]);
    const tg_real inverse_mass = tgi_inverse_mass(f, call->now);
    for (int i = 0; i < n; i++) plan->accelerometer[i] = call->now->load[i] * inverse_mass;
    plan->accelerometer[n] = -f->machine.gravity * plan->cosine[1] - call->now->hitch_load * inverse_mass;
    plan->accelerometer_shift = -call->now->drawbar * inverse_mass;
    return TG_OK;
}

/* Field by field: a whole structure is copied by a slow instruction. */
TG_INLINE void plan_copy_passage(tg_passage *to, const tg_passage *from, const int n)
{
    for (int i = 0; i < n; i += TG_LANES) {
        lanes_store(to->phi + i, lanes_load(from->phi + i));
        lanes_store(to->psi + i, lanes_load(from->psi + i));
        lanes_store(to->b + i, lanes_load(from->b + i));
        lanes_store(to->c + i, lanes_load(from->c + i));
    }
    for (int j = 0; j < TG_TWICE(n); j += TG_LANES) lanes_store(to->q + j, lanes_load(from->q + j));
    to->keep = from->keep;
    to->g = from->g;
    to->dt = from->dt;
}

TG_INLINE tg_status plan_step(const tg_filter *f, const tgi_call *call, tgi_plan *plan, const int n)
{
    if (!(call->dt >= 0)) return TG_TIME_REVERSED;
    if (!tgi_finite(call->dt)) return TG_NOT_FINITE;
    tg_status status = plan_check_input(call->before, n);
    if (status != TG_OK) return status;
    plan->before = call->before;
    plan->count = 0;
    if (call->y) {
        if (call->now != call->before) status = plan_check_input(call->now, n);
        if (status == TG_OK) status = plan_channels(f, call, plan, n);
        if (status != TG_OK) return status;
    }
    tg_real *const q = plan->passage.q;
    for (int j = 0; j < TG_ROWS; j += TG_LANES) lanes_store(q + j, lanes_all(0));
    if (call->q_input) {
        tg_real zero = 0;
        int positive = 1;
        for (int e = 0; e < TG_TWICE(n); e++) {
            q[tgi_row(n, e)] = call->q_input[e];
            zero += call->q_input[e] * 0;
            positive &= !(call->q_input[e] < 0);
        }
        if (zero != 0) return TG_NOT_FINITE;
        if (!positive) return TG_NOT_POSITIVE;
    }
    return plan_passage(f, call->before, call->dt, plan, n);
}
#endif
