/* See plant.h. Time stepping: ROS2 (Verwer, Spee, Blom, Hundsdorfer 1999), a two-stage linearly implicit W-method: second
 * order whatever matrix stands in for the Jacobian. Here that is the stiff part alone, wheel speeds against ground speed
 * through the adhesion curve, an arrow matrix solved in O(wheels). */
#include "plant.h"

#include <math.h>
#include <string.h>

/* Where the parts of the state stand; `n` is the number of wheels, `m` the machine. */
#define OMEGA 0
#define V (n)
#define TORQUE (n + 1)
#define SUM (2 * n + 1)
#define Z (3 * n + 1)
#define ZDOT (4 * n + 1)
#define X (5 * n + 1)
#define RHO (5 * n + 2)
#define TOOL (5 * n + 2 + m->axles)
enum { NORMAL = 0, BOOST = 1, EASE = 2, ASSIST = 3 };

/* 1 - 1/sqrt(2): L-stable. */
#define GAMMA 0.29289321881345254

typedef struct { /* what changes seldom: the driver and where soft spots came to lie */
    int32_t mode;
    double mode_since, trouble_since, free_since, assist;
    double spot_position[8], spot_left[8]; /* where each soft spot lies, and how much of it is left */
    double sunk[8][PLANT_AXLES];           /* slip-sinkage of each axle in it, 0..1 */
    int32_t command_index;
} conduct;

typedef struct { /* what one evaluation found, besides the derivative */
    double acceleration, bar[2], slope, gradient_force, curvature, lift;
    double command;
    double slip[PLANT_WHEELS], adhesion[PLANT_WHEELS], load[PLANT_WHEELS], hub[PLANT_WHEELS], gradient[PLANT_WHEELS];
    double axle_load[PLANT_AXLES], resistance[PLANT_AXLES], draught[2];
    /* arrow Jacobian: d omega'_i / d omega_i, d omega'_i / d v, d v' / d omega_i, d v' / d v */
    double ww[PLANT_WHEELS], wv[PLANT_WHEELS], vw[PLANT_WHEELS], vv;
} findings;

static double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

typedef struct {
    int32_t i;
    double w;
} place;

static place locate(const plant_ground *g, double x) {
    const double last = (double)(g->count - 1) - 1e-9;
    double u = (x - g->start) / g->spacing;
    u = u > 0.0 ? (u < last ? u : last) : 0.0; /* NaN stays inside the arrays too */
    place p;
    p.i = (int32_t)u;
    p.w = u - p.i;
    return p;
}

static double at(const double *field, place p) { return field[p.i] + p.w * (field[p.i + 1] - field[p.i]); }

/* Adhesion and its slope at |slip| on one soil: cubic Hermite between the tabulated points. */
static void curve_at(const plant_ground *g, int32_t soil, double slip, double *mu, double *dmu) {
    const double h = 1.0 / g->curve_intervals;
    const double u = slip * g->curve_intervals;
    const int32_t i = u > 0.0 ? (u < g->curve_intervals ? (int32_t)u : g->curve_intervals - 1) : 0;
    const double t = u - i, q = 1.0 - t;
    const double *p = g->curve + 2 * ((int64_t)soil * (g->curve_intervals + 1) + i);
    const double p0 = p[0], m0 = p[1] * h, p1 = p[2], m1 = p[3] * h;
    *mu = p0 * (1.0 + 2.0 * t) * q * q + m0 * t * q * q + p1 * t * t * (3.0 - 2.0 * t) - m1 * t * t * q;
    *dmu = (6.0 * t * q * (p1 - p0) + m0 * q * (1.0 - 3.0 * t) + m1 * t * (3.0 * t - 2.0)) / h;
}

static double spot_share(const plant_machine *m, const conduct *c, int32_t k, double x) {
    const double d = fabs(x - c->spot_position[k]) / m->spot[k].length, edge = m->spot[k].edge;
    if (!(d < 0.5)) return 0.0;
    const double ramp = (d - (0.5 - edge)) / (2.0 * edge); /* below 0 on the plateau, 0.5 at the rim */
    return c->spot_left[k] * 0.5 * (1.0 + cos(6.283185307179586 * fmax(ramp, 0.0)));
}

/* Friction that builds up over a travel K (Dahl's model; for soil, Janosi and Hanamoto's shear displacement K), with a
 * damping that lives only while it builds up, so that the force never passes its limit. */
static double friction(double limit, double held, double speed, double length, double *rate) {
    const double lag = 0.03;
    if (held * speed < 0.0) length *= 0.2; /* soil springs back far stiffer than it gives way */
    *rate = speed / length * (limit - (speed < 0 ? -held : held));
    return held + *rate * lag * length / (length + lag * fabs(speed));
}

static double bar_force(const plant_tool *t, double gap, double rate) {
    const double half = 0.5 * t->bar_slack;
    if (gap > half) return fmax(0.0, t->bar_stiffness * (gap - half) + t->bar_damping * rate);
    if (gap < -half) return fmin(0.0, t->bar_stiffness * (gap + half) + t->bar_damping * rate);
    return 0.0;
}

static double command_at(const plant_machine *m, int32_t index, double time) {
    const double *t = m->command_time, *w = m->command;
    if (isnan(w[index])) return NAN;
    if (index + 1 >= m->commands || isnan(w[index + 1])) return w[index];
    return w[index] + (w[index + 1] - w[index]) * clamp((time - t[index]) / (t[index + 1] - t[index]), 0.0, 1.0);
}

static double driven_command(const plant_machine *m, const conduct *c, double time) {
    const double w = command_at(m, c->command_index, time);
    if (c->mode == BOOST) return w * m->driver.boost;
    if (c->mode == EASE) return w * m->driver.ease;
    return w;
}

/* Motor torques asked for: speed control, then the limits of torque and of power. */
static void control(const plant_machine *m, const double *y, double command, double curvature, double *dy) {
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

static void tools(const plant_machine *m, const plant_ground *g, const double *y, double *dy, findings *f) {
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
        f->draught[k] = friction(limit, s[2], s[1], t->shear_length, &ds[2]);
        ds[0] = s[1];
        ds[1] = (f->bar[k] - (k + 1 < m->tools ? f->bar[k + 1] : 0.0) - f->draught[k] - weight * sin(slope)) / t->mass;
    }
}

/* Slip with its sign of force, over no less than `slip_speed`; derivatives by rim and hub speed. */
static double slip_of(double rim, double hub, double floor, double *by_rim, double *by_hub) {
    const double a = fabs(rim), b = fabs(hub), d = fmax(fmax(a, b), floor), s = (rim - hub) / d;
    *by_rim = 1.0 / d;
    *by_hub = -1.0 / d;
    if (d == a) *by_rim -= s * (rim < 0 ? -1.0 : 1.0) / d;
    else if (d == b) *by_hub -= s * (hub < 0 ? -1.0 : 1.0) / d;
    if (fabs(s) > 1.0) {
        *by_rim = *by_hub = 0.0;
        return s < 0 ? -1.0 : 1.0;
    }
    return s;
}

static void derive(const plant_machine *m, const plant_ground *g, const conduct *c, double time, const double *y, double *dy,
                   findings *f) {
    const int n = m->wheels;
    const double weight = m->mass * m->gravity, v = y[V];
    const place cg = locate(g, y[X] + m->rear_to_cg);
    const double slope = at(g->slope, cg), sine = sin(slope), normal = weight * cos(slope);
    double pull = 0.0, spin = 0.0, critical[PLANT_AXLES] = {0.0}, spring[PLANT_WHEELS];
    int on_axle[PLANT_AXLES] = {0};
    memset(dy, 0, (size_t)(TOOL + 6) * sizeof *dy);
    for (int i = 0; i < n; i++) on_axle[m->wheel_axle[i]]++;
    f->slope = slope;
    f->curvature = at(g->curvature, cg);
    f->command = driven_command(m, c, time);
    f->gradient_force = 0.0;
    f->lift = -normal;
    f->vv = 0.0;
    control(m, y, f->command, f->curvature, dy);
    tools(m, g, y, dy, f);
    for (int i = 0; i < n; i++) {
        const int track = m->wheel_track[i], axle = m->wheel_axle[i];
        const double x = y[X] + m->axle_position[axle], r = m->radius[i], w = y[OMEGA + i];
        const place p = locate(g, x);
        const double hub_by_v = 1.0 - m->side[i] * f->curvature, hub = v * hub_by_v;
        double keep = 1.0, sink = 0.0, stretch = 1.0, by_rim, by_hub, mu, dmu;
        for (int k = 0; k < m->spots; k++) {
            const plant_spot *spot = &m->spot[k];
            const double share = spot_share(m, c, k, x), sunk = c->sunk[k][axle];
            keep *= 1.0 - (spot->adhesion_loss + spot->adhesion_fall * sunk) * share;
            sink += spot->resistance[axle] * (1.0 + spot->sinkage * sunk) * share;
            stretch += spot->loosening * share;
        }
        const double slip = slip_of(r * w, hub, m->slip_speed, &by_rim, &by_hub), size = fabs(slip);
        const int32_t from = g->soil_from[track][p.i], to = g->soil_to[track][p.i];
        const double scale = keep * at(g->adhesion_scale[track], p);
        curve_at(g, from, size / stretch, &mu, &dmu);
        if (to != from) {
            double other, dother;
            const double blend = at(g->blend[track], p);
            curve_at(g, to, size / stretch, &other, &dother);
            mu += blend * (other - mu);
            dmu += blend * (dother - dmu);
        }
        mu *= slip < 0 ? -scale : scale;
        dmu *= scale / stretch;
        const double ground = at(g->elevation[track], p), gradient = at(g->gradient[track], p);
        const double static_load = weight * m->axle_share[axle] / on_axle[axle];
        spring[i] = fmax(0.0, static_load + m->tire_stiffness * (ground - y[Z + i]) +
                                  m->tire_damping * (gradient * hub - y[ZDOT + i]));
        const double load = g->load_variation[i] ? spring[i] * (1.0 + at(g->load_variation[i], p)) : spring[i];
        const double rest = clamp(w / m->wheel_rest_speed, -1.0, 1.0);
        const double traction = mu * load, J = m->inertia[i];
        dy[OMEGA + i] = (y[TORQUE + i] - r * traction - r * m->tire_resistance * load * rest - r * m->bearing[i] * w) / J;
        dy[Z + i] = y[ZDOT + i];
        spin += J * dy[OMEGA + i];
        pull += traction;
        f->lift += spring[i];
        f->gradient_force += gradient * load;
        critical[axle] += (at(g->resistance[track], p) + sink + at(g->slip_resistance[track], p) * size) / on_axle[axle];
        f->slip[i] = slip;
        f->adhesion[i] = mu;
        f->load[i] = load;
        f->hub[i] = hub;
        f->gradient[i] = gradient;
        const double stiff = dmu * load;
        f->ww[i] = -(r * stiff * by_rim * r + r * m->bearing[i] +
                     (fabs(rest) < 1.0 ? r * m->tire_resistance * load / m->wheel_rest_speed : 0.0)) / J;
        f->wv[i] = -r * stiff * by_hub * hub_by_v / J;
        f->vw[i] = stiff * by_rim * r / m->mass;
        f->vv += stiff * by_hub * hub_by_v / m->mass;
    }

    /* Axle loads follow dv/dt (physics.md 3; more than two axles as a rigid body on equal springs) and rolling resistance follows
     * the loads: one linear equation in dv/dt. The push of an operator acts at the hitch. Rolling resistance takes loads
     * without roughness: a rut forms over the contact. */
    const double hitch = f->bar[0] - c->assist;
    double centre = 0.0, spread = 0.0, by_acceleration[PLANT_AXLES];
    for (int a = 0; a < m->axles; a++) centre += m->axle_position[a] / m->axles;
    for (int a = 0; a < m->axles; a++) spread += (m->axle_position[a] - centre) * (m->axle_position[a] - centre);
    const double moment = -weight * sine * m->cg_height - hitch * m->hitch_height - spin;
    double force = pull - hitch - f->gradient_force - weight * sine, inert = m->mass;
    for (int a = 0; a < m->axles; a++) {
        const double arm = spread > 0.0 ? (m->axle_position[a] - centre) / spread : 0.0; /* one axle: the hitch takes moments */
        by_acceleration[a] = -m->mass * m->cg_height * arm;
        f->axle_load[a] = normal * m->axle_share[a] + moment * arm;
        f->resistance[a] = friction(critical[a], y[RHO + a], v, m->resistance_length, &dy[RHO + a]);
        force -= f->resistance[a] * f->axle_load[a];
        inert += f->resistance[a] * by_acceleration[a];
    }
    f->acceleration = force / inert;
    for (int a = 0; a < m->axles; a++) f->axle_load[a] += by_acceleration[a] * f->acceleration;
    dy[V] = f->acceleration;
    dy[X] = v;
    const double lateral = v * v * f->curvature / m->gravity * m->cg_height;
    double width[PLANT_AXLES] = {0.0};
    for (int i = 0; i < n; i++) width[m->wheel_axle[i]] += m->side[i] * m->side[i];
    for (int i = 0; i < n; i++) {
        const int axle = m->wheel_axle[i];
        const double share = 1.0 / on_axle[axle] - (width[axle] > 0.0 ? lateral * m->side[i] / width[axle] : 0.0);
        const double corner = m->mass * m->axle_share[axle] / on_axle[axle];
        double torsion = 0.0;
        for (int j = 0; j < n; j++) torsion += m->warp[PLANT_WHEELS * i + j] * y[Z + j];
        dy[ZDOT + i] = (spring[i] - f->axle_load[axle] * share - torsion) / corner;
    }
}

/* Solve (I - GAMMA h A) k = k in place, A the arrow matrix of wheel speeds and ground speed. */
static void solve(const plant_machine *m, const findings *f, double h, double *k) {
    const int n = m->wheels;
    const double q = GAMMA * h;
    double pivot = 1.0 - q * f->vv, right = k[V];
    for (int i = 0; i < n; i++) {
        const double d = 1.0 - q * f->ww[i];
        pivot -= q * f->vw[i] * q * f->wv[i] / d;
        right += q * f->vw[i] * k[OMEGA + i] / d;
    }
    k[V] = right / pivot;
    for (int i = 0; i < n; i++) k[OMEGA + i] = (k[OMEGA + i] + q * f->wv[i] * k[V]) / (1.0 - q * f->ww[i]);
}

static void advance(const plant_machine *m, const plant_ground *g, const conduct *c, double time, double h, double *y) {
    const int n = m->wheels, states = TOOL + 6;
    double k1[PLANT_STATES], k2[PLANT_STATES], mid[PLANT_STATES];
    findings f, unused;
    derive(m, g, c, time, y, k1, &f);
    /* The time derivative of the command is left out of A; the second stage sees the command at the step's end. */
    solve(m, &f, h, k1);
    for (int j = 0; j < states; j++) mid[j] = y[j] + h * k1[j];
    derive(m, g, c, time + h, mid, k2, &unused);
    for (int j = 0; j < states; j++) k2[j] -= 2.0 * k1[j];
    solve(m, &f, h, k2);
    for (int j = 0; j < states; j++) y[j] += h * (1.5 * k1[j] + 0.5 * k2[j]);
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
static void drive(const plant_machine *m, conduct *c, double time, double h, const double *y) {
    const int n = m->wheels;
    const plant_driver *d = &m->driver;
    while (c->command_index + 1 < m->commands && m->command_time[c->command_index + 1] <= time) c->command_index++;
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

/* The straight line's slope through corner values over the length of the machine; 0 with one axle. */
static double pitch_of(const plant_machine *m, const double *corner) {
    double centre = 0.0, moment = 0.0, spread = 0.0;
    for (int i = 0; i < m->wheels; i++) centre += m->axle_position[m->wheel_axle[i]] / m->wheels;
    for (int i = 0; i < m->wheels; i++) {
        const double arm = m->axle_position[m->wheel_axle[i]] - centre;
        moment += arm * corner[i];
        spread += arm * arm;
    }
    return spread > 0.0 ? moment / spread : 0.0;
}

static void record(const plant_machine *m, const plant_ground *g, const conduct *c, double time, const double *y, double *row) {
    const int n = m->wheels;
    double dy[PLANT_STATES];
    findings f;
    derive(m, g, c, time, y, dy, &f);
    row[PLANT_TIME] = time;
    row[PLANT_POSITION] = y[X];
    row[PLANT_SPEED] = y[V];
    row[PLANT_ACCELERATION] = f.acceleration;
    row[PLANT_DRAWBAR] = f.bar[0];
    row[PLANT_SLOPE] = f.slope;
    row[PLANT_GRADIENT_FORCE] = f.gradient_force;
    row[PLANT_ASSIST] = c->assist;
    row[PLANT_BODY_PITCH] = pitch_of(m, y + Z);
    row[PLANT_BODY_PITCH_RATE] = pitch_of(m, y + ZDOT);
    row[PLANT_HEAVE_ACCELERATION] = f.lift / m->mass;
    row[PLANT_CURVATURE] = f.curvature;
    row[PLANT_DRIVER_MODE] = c->mode;
    row[PLANT_COMMAND] = f.command;
    for (int k = 0; k < 2; k++) {
        row[PLANT_TOOL1_POSITION + 3 * k] = y[TOOL + 3 * k];
        row[PLANT_TOOL1_SPEED + 3 * k] = y[TOOL + 3 * k + 1];
        row[PLANT_TOOL1_DRAUGHT + 3 * k] = f.draught[k];
    }
    row[PLANT_BAR2] = f.bar[1];
    for (int k = 0; k < 3; k++) row[PLANT_SPOT1 + k] = k < m->spots ? c->spot_position[k] : NAN;
    double *axle = row + PLANT_SCALARS, *wheel = axle + PLANT_AXLE_COLUMNS * m->axles;
    for (int a = 0; a < m->axles; a++) {
        axle[PLANT_AXLE_LOAD * m->axles + a] = f.axle_load[a];
        axle[PLANT_RESISTANCE * m->axles + a] = f.resistance[a];
    }
    for (int i = 0; i < n; i++) {
        wheel[PLANT_WHEEL_SPEED * n + i] = y[OMEGA + i];
        wheel[PLANT_TORQUE * n + i] = y[TORQUE + i];
        wheel[PLANT_SLIP * n + i] = f.slip[i];
        wheel[PLANT_ADHESION * n + i] = f.adhesion[i];
        wheel[PLANT_LOAD * n + i] = f.load[i];
        wheel[PLANT_HUB_SPEED * n + i] = f.hub[i];
        wheel[PLANT_GRADIENT * n + i] = f.gradient[i];
        wheel[PLANT_HEIGHT * n + i] = y[Z + i];
        wheel[PLANT_WHEEL_ACCELERATION * n + i] = dy[OMEGA + i];
    }
}

static int lengths_positive(const plant_machine *m) {
    for (int k = 0; k < m->spots && k < 8; k++)
        if (!(m->spot[k].edge > 0 && m->spot[k].edge <= 0.5 && m->spot[k].sinkage_length > 0)) return 0;
    return 1;
}

static int layout_known(const plant_machine *m) {
    int on_axle[PLANT_AXLES] = {0};
    if (m->wheels < 1 || m->wheels > PLANT_WHEELS || m->axles < 1 || m->axles > PLANT_AXLES) return 0;
    for (int i = 0; i < m->wheels; i++) {
        if (m->wheel_axle[i] < 0 || m->wheel_axle[i] >= m->axles || m->wheel_track[i] < 0 || m->wheel_track[i] > 1) return 0;
        on_axle[m->wheel_axle[i]]++;
    }
    for (int a = 0; a < m->axles; a++)
        if (!on_axle[a] || !(m->axle_share[a] > 0)) return 0;
    return 1;
}

static int usable(const plant_machine *m, const plant_ground *g) {
    return m && g && g->count >= 2 && g->spacing > 0 && g->soils >= 1 && g->curve_intervals >= 1 && m->tools >= 0 &&
           m->tools <= 2 && m->spots >= 0 && m->spots <= 8 && m->commands >= 1 && m->mass > 0 && m->motor_lag > 0 &&
           m->slip_speed > 0 && m->wheel_rest_speed > 0 && lengths_positive(m) && layout_known(m);
}

int32_t plant_columns(const plant_machine *m) {
    return PLANT_SCALARS + PLANT_AXLE_COLUMNS * m->axles + PLANT_WHEEL_COLUMNS * m->wheels;
}

static void settle(const plant_machine *m, conduct *c) {
    memset(c, 0, sizeof *c);
    for (int k = 0; k < 8; k++) {
        c->spot_position[k] = k < m->spots ? m->spot[k].position : NAN;
        c->spot_left[k] = 1.0;
    }
}

plant_status plant_start(const plant_machine *m, const plant_ground *g, double position, double *y) {
    if (!usable(m, g) || !y) return PLANT_BAD_ARGUMENT;
    const int n = m->wheels;
    memset(y, 0, (size_t)(TOOL + 6) * sizeof *y);
    y[X] = position;
    for (int i = 0; i < n; i++)
        y[Z + i] = at(g->elevation[m->wheel_track[i]], locate(g, position + m->axle_position[m->wheel_axle[i]]));
    double ahead = position - m->hitch_overhang;
    for (int k = 0; k < m->tools; k++) ahead = y[TOOL + 3 * k] = ahead - m->tool[k].length; /* in the middle of its play */
    return PLANT_OK;
}

plant_status plant_derivative(const plant_machine *m, const plant_ground *g, double time, const double *y, double *dy) {
    conduct c;
    findings f;
    if (!usable(m, g) || !y || !dy) return PLANT_BAD_ARGUMENT;
    settle(m, &c);
    while (c.command_index + 1 < m->commands && m->command_time[c.command_index + 1] <= time) c.command_index++;
    derive(m, g, &c, time, y, dy, &f);
    return PLANT_OK;
}

plant_status plant_run(const plant_machine *m, const plant_ground *g, double position, double step, int32_t steps,
                       int32_t stride, double *trace, int32_t *rows) {
    conduct c;
    double y[PLANT_STATES];
    if (!usable(m, g) || !trace || !rows || !(step > 0) || steps < 0 || stride < 1) return PLANT_BAD_ARGUMENT;
    const int n = m->wheels, columns = plant_columns(m), states = TOOL + 6;
    settle(m, &c);
    plant_start(m, g, position, y);
    const double end = g->start + (g->count - 1) * g->spacing - m->axle_position[0];
    *rows = 0;
    for (int32_t k = 0;; k++) {
        const double time = k * step;
        drive(m, &c, time, step, y);
        if (k % stride == 0) record(m, g, &c, time, y, trace + (int64_t)columns * (*rows)++);
        if (k == steps || y[X] >= end) break;
        advance(m, g, &c, time, step, y);
        double sum = 0.0;
        for (int j = 0; j < states; j++) sum += y[j];
        if (!isfinite(sum)) return PLANT_NOT_FINITE;
    }
    return PLANT_OK;
}
