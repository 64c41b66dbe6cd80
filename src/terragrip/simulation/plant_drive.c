/* See plant.h. Motors under speed control, tow bars with slack, and the tools behind them. */
#include "plant_inside.h"

/* Motor torques asked for: speed control, then the limits of torque and of power. */
void plant_control(const plant_machine *m, const double *y, double command, double curvature, double *dy) {
    const int n = m->wheels;
    double want[PLANT_WHEELS], given[PLANT_WHEELS], error[PLANT_WHEELS], power = 0.0;
    const int off = isnan(command);
    for (int i = 0; i < n; i++) {
        const double turn = m->steers ? 1.0 - m->side[i] * curvature : 1.0;
        error[i] = command * m->command_ratio[i] * turn - y[OMEGA + i];
        want[i] = off || !m->driven[i] ? 0.0 : m->speed_gain * error[i] + y[SUM + i];
        given[i] = clamp(want[i], -m->torque_limit, m->torque_limit);
        power += fmax(0.0, given[i] * y[OMEGA + i]);
    }
    const double share = power > m->power_limit ? m->power_limit / power : 1.0;
    for (int i = 0; i < n; i++) {
        if (given[i] * y[OMEGA + i] > 0.0) given[i] *= share;
        dy[TORQUE + i] = (given[i] - y[TORQUE + i]) / m->motor_lag;
        dy[SUM + i] = off || !m->driven[i] ? -y[SUM + i] / m->antiwindup_time
                                           : m->speed_integral * error[i] + (given[i] - want[i]) / m->antiwindup_time;
    }
}

static double bar_force(const plant_tool *t, double gap, double rate) {
    const double half = 0.5 * t->bar_slack;
    if (gap > half) return fmax(0.0, t->bar_stiffness * (gap - half) + t->bar_damping * rate);
    if (gap < -half) return fmin(0.0, t->bar_stiffness * (gap + half) + t->bar_damping * rate);
    return 0.0;
}

void plant_tools(const plant_machine *m, const plant_ground *g, const double *y, double *dy, findings *f) {
    const int n = m->wheels;
    double ahead = y[X] - m->hitch_overhang, ahead_speed = y[V];
    f->bar[0] = f->bar[1] = f->draught[0] = f->draught[1] = 0.0;
    for (int k = 0; k < m->tools; k++) {
        const plant_tool *t = &m->tool[k];
        const double *s = y + TOOL + 3 * k;
        f->bar[k] = bar_force(t, ahead - s[0] - t->length, ahead_speed - s[1]);
        ahead = s[0];
        ahead_speed = s[1];
    }
    for (int k = 0; k < m->tools; k++) {
        const plant_tool *t = &m->tool[k];
        const double *s = y + TOOL + 3 * k;
        double *ds = dy + TOOL + 3 * k;
        const place p = locate(g, s[0]);
        const double slope = at(g->slope, p), weight = t->mass * m->gravity;
        const double limit = (at(t->friction, p) * weight * cos(slope) + at(t->dig_in, p)) *
                             (1.0 + t->draught_speed * fabs(s[1]));
        f->draught[k] = plant_friction(limit, s[2], s[1], t->shear_length, &ds[2]);
        ds[0] = s[1];
        ds[1] = (f->bar[k] - (k + 1 < m->tools ? f->bar[k + 1] : 0.0) - f->draught[k] - weight * sin(slope)) / t->mass;
    }
}
