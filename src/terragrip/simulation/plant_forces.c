/* See plant.h. The forces on wheels and vehicle: slip, adhesion, vertical loads, rolling resistance. */
#include "plant_inside.h"

#define LEAST_SHARE 0.1 /* of the static load: adhesion of a wheel about to lift is not without bounds */

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

/* Friction that builds up over a travel K (Dahl's model; for soil, Janosi and Hanamoto's shear displacement K), with a
 * damping that lives only while it builds up, so that the force never passes its limit. */
double plant_friction(double limit, double held, double speed, double length, double *rate) {
    const double lag = 0.03;
    if (held * speed < 0.0) length *= 0.2; /* soil springs back far stiffer than it gives way */
    *rate = speed / length * (limit - (speed < 0 ? -held : held));
    return held + *rate * lag * length / (length + lag * fabs(speed));
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

typedef struct { /* what the ground under one wheel does */
    double adhesion, by_slip; /* and its slope */
    double resistance;        /* ratio at full build-up */
    double elevation, gradient;
} footing;

static footing footing_of(const plant_machine *m, const plant_ground *g, const conduct *c, double x, int i, double slip) {
    const int track = m->wheel_track[i], axle = m->wheel_axle[i];
    const place p = locate(g, x);
    const int32_t from = g->soil_from[track][p.i], to = g->soil_to[track][p.i];
    const double size = fabs(slip);
    double keep = 1.0, sink = 0.0, stretch = 1.0, mu, dmu;
    for (int k = 0; k < m->spots; k++) {
        const plant_spot *spot = &m->spot[k];
        const double share = plant_spot_share(m, c, k, x), sunk = c->sunk[k][axle];
        keep *= 1.0 - (spot->adhesion_loss + spot->adhesion_fall * sunk) * share;
        sink += spot->resistance[axle] * (1.0 + spot->sinkage * sunk) * share;
        stretch += spot->loosening * share;
    }
    curve_at(g, from, size / stretch, &mu, &dmu);
    if (to != from) {
        double other, dother;
        const double blend = at(g->blend[track], p);
        curve_at(g, to, size / stretch, &other, &dother);
        mu += blend * (other - mu);
        dmu += blend * (dother - dmu);
    }
    const double scale = keep * at(g->adhesion_scale[track], p);
    const footing found = {mu * (slip < 0 ? -scale : scale), dmu * (scale / stretch),
                           at(g->resistance[track], p) + sink + at(g->slip_resistance[track], p) * size,
                           at(g->elevation[track], p), at(g->gradient[track], p)};
    return found;
}

/* Soil that yields under load bears less of it: Brixius' curves fall with the load, through the mobility number. */
static void soften(footing *foot, double factor) {
    foot->adhesion *= factor;
    foot->by_slip *= factor;
}

/* One wheel: its slip, what it carries and pulls, and its row of the Jacobian. */
static void wheel(const plant_machine *m, const plant_ground *g, const conduct *c, int i, const double *y, double *dy, findings *f) {
    const int n = m->wheels, axle = m->wheel_axle[i];
    const double x = y[X] + m->axle_position[axle], r = m->radius[i], w = y[OMEGA + i], J = m->inertia[i];
    const double hub_by_v = 1.0 - m->side[i] * f->curvature, hub = y[V] * hub_by_v;
    double by_rim, by_hub;
    const double slip = slip_of(r * w, hub, m->slip_speed, &by_rim, &by_hub);
    footing foot = footing_of(m, g, c, x, i, slip);
    const double static_load = m->mass * m->gravity * m->axle_share[axle] * m->wheel_share[i];
    const double spring = fmax(0.0, static_load + m->tire_stiffness * (foot.elevation - y[Z + i]) +
                                        m->tire_damping * (foot.gradient * hub - y[ZDOT + i]));
    const double load = g->load_variation[i] ? spring * (1.0 + at(g->load_variation[i], locate(g, x))) : spring;
    if (m->load_softening > 0) soften(&foot, pow(fmax(load / static_load, LEAST_SHARE), -m->load_softening));
    const double rest = clamp(w / m->wheel_rest_speed, -1.0, 1.0), traction = foot.adhesion * load;
    dy[OMEGA + i] = (y[TORQUE + i] - r * traction - r * m->tire_resistance * load * rest - r * m->bearing[i] * w) / J;
    dy[Z + i] = y[ZDOT + i];
    f->spin += J * dy[OMEGA + i];
    f->pull += traction;
    f->lift += spring;
    f->gradient_force += foot.gradient * load;
    f->critical[axle] += foot.resistance * m->wheel_share[i];
    f->spring[i] = spring;
    f->slip[i] = slip;
    f->adhesion[i] = foot.adhesion;
    f->load[i] = load;
    f->hub[i] = hub;
    f->gradient[i] = foot.gradient;
    const double stiff = foot.by_slip * load;
    f->ww[i] = -(r * stiff * by_rim * r + r * m->bearing[i] +
                 (fabs(rest) < 1.0 ? r * m->tire_resistance * load / m->wheel_rest_speed : 0.0)) / J;
    f->wv[i] = -r * stiff * by_hub * hub_by_v / J;
    f->vw[i] = stiff * by_rim * r / m->mass;
    f->vv += stiff * by_hub * hub_by_v / m->mass;
}

/* Axle loads follow dv/dt (physics.md 3; shares and levers come from physics/loads.py) and rolling resistance follows the loads: one linear
 * equation in dv/dt. The push of an operator acts at the hitch. Rolling resistance takes loads without roughness: a rut forms over the
 * contact. */
static void vehicle(const plant_machine *m, const conduct *c, const double *y, double *dy, findings *f) {
    const int n = m->wheels;
    const double weight = m->mass * m->gravity, along = weight * sin(f->slope), normal = weight * cos(f->slope);
    const double hitch = f->bar[0] - c->assist;
    const double moment = -along * m->cg_height - hitch * m->hitch_height - f->spin;
    double force = f->pull - hitch - f->gradient_force - along, inert = m->mass, by_acceleration[PLANT_AXLES];
    for (int a = 0; a < m->axles; a++) {
        by_acceleration[a] = -m->mass * m->cg_height * m->axle_lever[a];
        f->axle_load[a] = normal * m->axle_share[a] + moment * m->axle_lever[a];
        f->resistance[a] = plant_friction(f->critical[a], y[RHO + a], y[V], m->resistance_length, &dy[RHO + a]);
        force -= f->resistance[a] * f->axle_load[a];
        inert += f->resistance[a] * by_acceleration[a];
    }
    f->acceleration = force / inert;
    for (int a = 0; a < m->axles; a++) f->axle_load[a] += by_acceleration[a] * f->acceleration;
    dy[V] = f->acceleration;
    dy[X] = y[V];
}

/* The corners' springs carry what each wheel's share of its axle's load is. */
static void corners(const plant_machine *m, const double *y, double *dy, const findings *f) {
    const int n = m->wheels;
    const double lateral = y[V] * y[V] * f->curvature;
    for (int i = 0; i < n; i++) {
        const int axle = m->wheel_axle[i];
        const double share = m->wheel_share[i] - m->lateral_share[i] * lateral;
        double torsion = 0.0;
        for (int j = 0; j < n; j++) torsion += m->warp[PLANT_WHEELS * i + j] * y[Z + j];
        dy[ZDOT + i] = (f->spring[i] - f->axle_load[axle] * share - torsion) / (m->mass * m->axle_share[axle] * m->wheel_share[i]);
    }
}

void plant_derive(const plant_machine *m, const plant_ground *g, const conduct *c, double time, const double *y, double *dy, findings *f) {
    const int n = m->wheels;
    const place cg = locate(g, y[X] + m->rear_to_cg);
    memset(dy, 0, (size_t)(TOOL + 6) * sizeof *dy);
    f->slope = at(g->slope, cg);
    f->curvature = at(g->curvature, cg);
    f->command = plant_command(m, c, time);
    f->lift = -m->mass * m->gravity * cos(f->slope);
    f->pull = f->spin = f->gradient_force = f->vv = 0.0;
    memset(f->critical, 0, sizeof f->critical);
    plant_control(m, y, f->command, f->curvature, dy);
    plant_tools(m, g, y, dy, f);
    for (int i = 0; i < n; i++) wheel(m, g, c, i, y, dy, f);
    vehicle(m, c, y, dy, f);
    corners(m, y, dy, f);
}
