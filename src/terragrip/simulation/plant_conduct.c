/* See plant.h. The driver: commands, and what he does in trouble; and soft spots, which change under the wheels. */
#include "plant_inside.h"

void plant_settle(const plant_machine *m, conduct *c) {
    memset(c, 0, sizeof *c);
    for (int k = 0; k < 8; k++) {
        c->spot_position[k] = k < m->spots ? m->spot[k].position : NAN;
        c->spot_left[k] = 1.0;
    }
}

double plant_spot_share(const plant_machine *m, const conduct *c, int32_t k, double x) {
    const double d = fabs(x - c->spot_position[k]) / m->spot[k].length, edge = m->spot[k].edge;
    if (!(d < 0.5)) return 0.0;
    const double ramp = (d - (0.5 - edge)) / (2.0 * edge); /* below 0 on the plateau, 0.5 at the rim */
    return c->spot_left[k] * 0.5 * (1.0 + cos(6.283185307179586 * fmax(ramp, 0.0)));
}

static double command_at(const plant_machine *m, int32_t index, double time) {
    const double *t = m->command_time, *w = m->command;
    if (isnan(w[index])) return NAN;
    if (index + 1 >= m->commands || isnan(w[index + 1])) return w[index];
    return w[index] + (w[index + 1] - w[index]) * clamp((time - t[index]) / (t[index + 1] - t[index]), 0.0, 1.0);
}

double plant_command(const plant_machine *m, const conduct *c, double time) {
    const double w = command_at(m, c->command_index, time);
    if (c->mode == BOOST) return w * m->driver.boost;
    if (c->mode == EASE) return w * m->driver.ease;
    return w;
}

/* The last command point that has passed. */
void plant_follow_command(const plant_machine *m, conduct *c, double time) {
    while (c->command_index + 1 < m->commands && m->command_time[c->command_index + 1] <= time) c->command_index++;
}

/* Wheels that spin in a soft spot grind it away. */
static void grind(const plant_machine *m, conduct *c, double h, const double *y) {
    const int n = m->wheels;
    for (int k = 0; k < m->spots; k++)
        for (int i = 0; m->spot[k].wear > 0 && i < n; i++) {
            const double d = y[X] + m->axle_position[m->wheel_axle[i]] - c->spot_position[k];
            if (fabs(d) < 0.5 * m->spot[k].length)
                c->spot_left[k] *= exp(-0.5 * h * fabs(m->radius[i] * y[OMEGA + i] - y[V]) / m->spot[k].wear);
        }
}

/* A wheel digs itself in by the soil that it moves: sinkage follows slip over a length of the rim's travel (R). */
static void sink_in(const plant_machine *m, conduct *c, double h, const double *y) {
    const int n = m->wheels;
    double rim[PLANT_AXLES] = {0.0}, on_axle[PLANT_AXLES] = {0.0};
    for (int i = 0; i < n; i++) {
        rim[m->wheel_axle[i]] += m->radius[i] * y[OMEGA + i];
        on_axle[m->wheel_axle[i]] += 1.0;
    }
    for (int a = 0; a < m->axles; a++) {
        const double mean = rim[a] / on_axle[a], larger = fmax(fmax(fabs(mean), fabs(y[V])), m->slip_speed);
        const double slip = fmin(fabs(mean - y[V]) / larger, 1.0);
        for (int k = 0; k < m->spots; k++)
            c->sunk[k][a] += (1.0 - exp(-h * larger / m->spot[k].sinkage_length)) * (slip - c->sunk[k][a]);
    }
}

static void enter(conduct *c, int32_t mode, double time) {
    c->mode = mode;
    c->mode_since = time;
}

/* What the driver does when the machine hardly moves: more speed, less speed, then somebody pushes until it runs again. */
void plant_conduct(const plant_machine *m, conduct *c, double time, double h, const double *y) {
    const int n = m->wheels;
    const plant_driver *d = &m->driver;
    plant_follow_command(m, c, time);
    for (int k = 0; k < m->spots; k++)
        if (isnan(c->spot_position[k]) && time >= m->spot[k].time) {
            const int front_sinks = m->spot[k].resistance[0] > m->spot[k].resistance[m->axles - 1];
            c->spot_position[k] = y[X] + (front_sinks ? m->axle_position[0] : 0.0) + m->spot[k].ahead;
        }
    grind(m, c, h, y);
    sink_in(m, c, h, y);
    const double want = command_at(m, c->command_index, time) * m->radius[0];
    const double share = want > 0.05 ? y[V] / want : 1.0;
    const double in_mode = time - c->mode_since;
    if (!(share < d->stuck_ratio)) c->trouble_since = time;
    if (!(share > d->free_ratio)) c->free_since = time;
    if (!d->enabled) return;
    if (c->mode == NORMAL && time - c->trouble_since > d->patience) enter(c, BOOST, time);
    else if (c->mode == BOOST && in_mode > d->boost_time) enter(c, EASE, time);
    else if (c->mode == EASE && in_mode > d->ease_time) enter(c, ASSIST, time);
    if (c->mode != NORMAL && time - c->free_since > d->free_time) enter(c, NORMAL, time);
    if (c->mode == ASSIST) c->assist = fmin(c->assist + d->assist_rate * h, d->assist_limit);
    else c->assist = fmax(c->assist - 2.0 * d->assist_rate * h, 0.0);
}
