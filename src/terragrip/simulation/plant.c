/* See plant.h. Time stepping: ROS2 (Verwer, Spee, Blom, Hundsdorfer 1999), a two-stage linearly implicit W-method: second
 * order whatever matrix stands in for the Jacobian. Here that is the stiff part alone, wheel speeds against ground speed
 * through the adhesion curve, an arrow matrix solved in O(wheels). */
#include "plant_inside.h"

/* 1 - 1/sqrt(2): L-stable. */
#define GAMMA 0.29289321881345254
#define CLOSE 0.02 /* of the slip floor: error of a rim speed in one step */
#define HALVINGS 5

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

/* A step in which some rim speed's error (second order against first) is larger than CLOSE of the slip floor is done in halves:
 * near standstill wheels would jump to and fro over the peak of a curve (docs/decisions/0020). */
static void advance(const plant_machine *m, const plant_ground *g, const conduct *c, double time, double h, int halvings, double *y) {
    const int n = m->wheels, states = TOOL + 6;
    double k1[PLANT_STATES], k2[PLANT_STATES], mid[PLANT_STATES], error = 0.0;
    findings f, unused;
    plant_derive(m, g, c, time, y, k1, &f);
    /* The time derivative of the command is left out of A; the second stage sees the command at the step's end. */
    solve(m, &f, h, k1);
    for (int j = 0; j < states; j++) mid[j] = y[j] + h * k1[j];
    plant_derive(m, g, c, time + h, mid, k2, &unused);
    for (int j = 0; j < states; j++) k2[j] -= 2.0 * k1[j];
    solve(m, &f, h, k2);
    for (int i = 0; i < n; i++) error = fmax(error, m->radius[i] * fabs(0.5 * h * (k1[OMEGA + i] + k2[OMEGA + i])));
    if (halvings > 0 && !(error <= CLOSE * m->slip_speed)) {
        advance(m, g, c, time, 0.5 * h, halvings - 1, y);
        advance(m, g, c, time + 0.5 * h, 0.5 * h, halvings - 1, y);
        return;
    }
    for (int j = 0; j < states; j++) y[j] += h * (1.5 * k1[j] + 0.5 * k2[j]);
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
    plant_derive(m, g, c, time, y, dy, &f);
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
    for (int i = 0; i < m->wheels; i++)
        if (!(m->wheel_share[i] > 0)) return 0;
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
    plant_settle(m, &c);
    plant_follow_command(m, &c, time);
    plant_derive(m, g, &c, time, y, dy, &f);
    return PLANT_OK;
}

plant_status plant_begin(const plant_machine *m, const plant_ground *g, double position, plant_memory *memory) {
    conduct c;
    if (!usable(m, g) || !memory) return PLANT_BAD_ARGUMENT;
    memset(memory, 0, sizeof *memory);
    plant_settle(m, &c);
    memcpy(memory->conduct, &c, sizeof c);
    return plant_start(m, g, position, memory->state);
}

plant_status plant_continue(const plant_machine *m, const plant_ground *g, plant_memory *memory, double step, int32_t steps,
                            int32_t stride, double *trace, int32_t *rows) {
    conduct c;
    if (!usable(m, g) || !memory || !trace || !rows || !(step > 0) || steps < 0 || stride < 1) return PLANT_BAD_ARGUMENT;
    const int n = m->wheels, columns = plant_columns(m), states = TOOL + 6;
    double *y = memory->state;
    const double end = g->start + (g->count - 1) * g->spacing - m->axle_position[0];
    plant_status status = PLANT_OK;
    memcpy(&c, memory->conduct, sizeof c);
    *rows = 0;
    for (int32_t k = 0; k < steps && !memory->ended; k++) {
        const double time = (double)memory->steps * step;
        plant_conduct(m, &c, time, step, y);
        if (memory->steps % stride == 0) record(m, g, &c, time, y, trace + (int64_t)columns * (*rows)++);
        memory->ended = y[X] >= end;
        if (memory->ended) break;
        advance(m, g, &c, time, step, HALVINGS, y);
        memory->steps++;
        double sum = 0.0;
        for (int j = 0; j < states; j++) sum += y[j];
        if (!isfinite(sum)) {
            status = PLANT_NOT_FINITE;
            break;
        }
    }
    memcpy(memory->conduct, &c, sizeof c);
    return status;
}

plant_status plant_run(const plant_machine *m, const plant_ground *g, double position, double step, int32_t steps,
                       int32_t stride, double *trace, int32_t *rows) {
    plant_memory memory;
    conduct c;
    plant_status status = plant_begin(m, g, position, &memory);
    if (status == PLANT_OK) status = plant_continue(m, g, &memory, step, steps, stride, trace, rows);
    if (status != PLANT_OK || memory.ended) return status;
    memcpy(&c, memory.conduct, sizeof c);
    plant_conduct(m, &c, (double)memory.steps * step, step, memory.state);
    if (memory.steps % stride == 0)
        record(m, g, &c, (double)memory.steps * step, memory.state, trace + (int64_t)plant_columns(m) * (*rows)++);
    return PLANT_OK;
}
