/* Vertical loads of axles and wheels (physics.md 3), and the inputs of a row. */
#include "estimator.h"

/* Specific force along the vehicle, dv/dt + g sin(slope): the accelerometer's where it is alive, else the balance of the estimated
 * forces; low-passed, for the loads do not follow a shock. */
static tg_real specific_force(tg_estimator *e, const tg_row *row)
{
    const tg_settings *s = &e->settings;
    tgi_lowpass(&e->acceleration, row->value[TG_ACCELERATION_X], row->time, s->load_filter);
    if (e->acceleration.seen && row->time - e->acceleration.time <= 1) return e->acceleration.value;
    return e->balance.seen ? e->balance.value : 0;
}

/* A value measured on an axle wins; axles without one share the rest of the weight by their static shares. */
static void take_measured(tg_estimator *e, const tg_row *row, tg_real weight, tg_real *load)
{
    const tg_settings *s = &e->settings;
    int32_t measured[8], any = 0;
    tg_real rest = weight, computed = 0, share = 0;
    for (int32_t k = 0; k < s->axles; k++) {
        tg_hold *h = &e->axle_load[k];
        tgi_hold_update(h, &s->tuned, row->value[TG_VERTICAL_LOAD + k], row->time, 0, s->noise[TG_VERTICAL_LOAD + k], 0, !e->standing);
        measured[k] = h->count > 0 && row->time - h->time <= 1;
        any |= measured[k];
        if (measured[k]) {
            load[k] = h->value;
            rest -= h->value;
        } else {
            computed += load[k];
            share += s->load_share[k];
        }
    }
    if (!any) return;
    for (int32_t k = 0; k < s->axles; k++)
        if (!measured[k]) load[k] += (rest - computed) * s->load_share[k] / share;
}

/* F_k = share_k m g cos + transfer_k moment, the moment that lifts the front being m h (dv/dt + g sin) + F_dx h_d + sum J dw/dt.
 * A wheel keeps at least 2 % of its static load: the model divides by it. */
void tgi_loads(tg_estimator *e, const tg_row *row, tg_drive *drive)
{
    const tg_settings *s = &e->settings;
    const tg_machine *m = &s->machine;
    tg_real a = specific_force(e, row), g = m->gravity;
    tg_real weight = m->mass * g * drive->cosine;
    tg_real moment = m->mass * s->center_of_gravity_height * a + drive->calm_drawbar * s->hitch_height
                   + e->constants.spin_inertia * (a - g * drive->sine);
    tg_real load[8];
    for (int32_t k = 0; k < s->axles; k++) load[k] = s->load_share[k] * weight - s->load_transfer[k] * moment;
    take_measured(e, row, weight, load);

    tg_real lateral = tgi_lowpass(&e->lateral, row->value[TG_ACCELERATION_Y], row->time, s->load_filter);
    if (!e->lateral.seen && !isnan(row->value[TG_ROLL])) lateral = g * tgi_sin(row->value[TG_ROLL]);
    for (int32_t k = 0; k < s->axles; k++) drive->axle_load[k] = load[k];
    for (int32_t i = 0; i < m->wheels; i++) {
        tg_real least = e->constants.least_load[i], wheel = load[s->wheel_axle[i]] * (s->wheel_share[i] - s->lateral_share[i] * lateral);
        drive->load[i] = wheel > least ? wheel : least;
    }
}
