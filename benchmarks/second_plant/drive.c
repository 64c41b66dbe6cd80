/* See drive.h. */
#include "drive.h"

#include <math.h>
#include <mujoco/mujoco.h>
#include <string.h>

typedef sp_memory memory;

typedef struct {
    double mu, load, resistance, hub, sinkage;
} contact;

static double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static double field_at(const sp_field *f, double x, double y, double *gx, double *gy) {
    double value = 0.0;
    for (int k = 0; k < f->count; k++) {
        const double angle = f->wave_x[k] * x + f->wave_y[k] * y + f->phase[k];
        value += f->amplitude[k] * cos(angle);
        if (gx) {
            const double slope = -f->amplitude[k] * sin(angle);
            *gx += slope * f->wave_x[k];
            *gy += slope * f->wave_y[k];
        }
    }
    return value;
}

static double height_at(const sp_machine *m, double x, double y, double *gx, double *gy) {
    *gx = *gy = 0.0;
    return field_at(&m->hills, x, y, gx, gy) + field_at(&m->roughness, x, y, gx, gy);
}

void sp_ground(const sp_machine *m, double x, double y, double *out) { out[0] = height_at(m, x, y, out + 1, out + 2); }

static int32_t after(const double *points, int32_t count, int32_t index, double at) {
    while (index + 1 < count && points[index + 1] <= at) index++;
    return index;
}

static double between(const double *points, const double *values, int32_t count, int32_t index, double at) {
    if (index + 1 >= count || isnan(values[index + 1])) return values[index];
    const double share = clamp((at - points[index]) / (points[index + 1] - points[index]), 0.0, 1.0);
    return values[index] + share * (values[index + 1] - values[index]);
}

/* Stresses of one soil at a sinkage, slip and dug-in slip, linear between nodes, added to `out` times `share`. */
static void look_up(const sp_soil *s, int wheel, double sinkage, double slip, double dug, double share, double *out) {
    const double u = clamp(sqrt(sinkage / s->deepest[wheel]), 0.0, 1.0) * (s->sinkages - 1);
    const double v = clamp(0.5 * (slip + 1.0), 0.0, 1.0) * (s->slips - 1), w = clamp(dug, 0.0, 1.0) * (s->depths - 1);
    const int i = (int)fmin(u, s->sinkages - 2), j = (int)fmin(v, s->slips - 2), k = (int)fmin(w, s->depths - 2);
    const double a[2] = {1.0 - (u - i), u - i}, b[2] = {1.0 - (v - j), v - j}, c[2] = {1.0 - (w - k), w - k};
    for (int p = 0; p < 2; p++)
        for (int q = 0; q < 2; q++)
            for (int r = 0; r < 2; r++) {
                const double *node = s->table[wheel] + (((int64_t)(i + p) * s->slips + j + q) * s->depths + k + r) * SP_VALUES;
                const double weight = share * a[p] * b[q] * c[r];
                for (int n = 0; n < SP_VALUES; n++) out[n] += weight * node[n];
            }
}

/* Motor torques: speed control of each wheel, limits of torque and of power, first-order motors. */
static double control(const sp_machine *m, memory *o, const mjData *d, double time, double dt) {
    o->at_command = after(m->command_time, m->commands, o->at_command, time);
    const double speed = between(m->command_time, m->command, m->commands, o->at_command, time);
    const double curvature = between(m->command_time, m->curvature, m->commands, o->at_command, time);
    const int off = isnan(m->command[o->at_command]);
    double want[SP_WHEELS], given[SP_WHEELS], power = 0.0;
    int steered = 0;
    for (int i = 0; i < m->wheels; i++) steered |= m->steered[i];
    o->steer = steered ? atan(m->wheelbase * curvature) : 0.0;
    for (int i = 0; i < m->wheels; i++) {
        const double w = d->qvel[m->base_dofs + i], e = speed * (1.0 - m->side[i] * curvature) / m->radius[i] - w;
        want[i] = off || !m->driven[i] ? 0.0 : m->speed_gain * e + o->sum[i];
        given[i] = clamp(want[i], -m->torque_limit, m->torque_limit);
        power += fmax(0.0, given[i] * w);
        o->sum[i] += dt * (off || !m->driven[i] ? -o->sum[i] / m->antiwindup_time
                                                : m->speed_integral * e + (given[i] - want[i]) / m->antiwindup_time);
    }
    const double share = power > m->power_limit ? m->power_limit / power : 1.0;
    for (int i = 0; i < m->wheels; i++) {
        if (given[i] * d->qvel[m->base_dofs + i] > 0.0) given[i] *= share;
        o->torque[i] += (1.0 - exp(-dt / m->motor_lag)) * (given[i] - o->torque[i]);
    }
    return off;
}

/* Soil under one wheel: forces into `xfrc_applied`, what it did into `c`. */
static void stand(const sp_machine *m, memory *o, const mjModel *model, mjData *d, const double *shares, int i, double dt,
                  contact *c, double *forward_normal) {
    const int body = m->wheel_body[i];
    const double *hub = d->xpos + 3 * body, *frame = d->xmat + 9 * m->chassis_body;
    const double ahead[3] = {frame[0], frame[3], frame[6]}, left[3] = {frame[1], frame[4], frame[7]};
    double gx, gy, velocity[6];
    const double height = height_at(m, hub[0], hub[1], &gx, &gy), size = sqrt(1.0 + gx * gx + gy * gy);
    const double up[3] = {-gx / size, -gy / size, 1.0 / size};
    double along[3], aside[3];
    const double turn = m->steered[i] ? o->steer : 0.0;
    for (int k = 0; k < 3; k++) along[k] = cos(turn) * ahead[k] + sin(turn) * left[k];
    const double lift = mju_dot3(along, up);
    for (int k = 0; k < 3; k++) along[k] -= lift * up[k];
    mju_normalize3(along);
    mju_cross(aside, up, along);
    mj_objectVelocity(model, d, mjOBJ_BODY, body, velocity, 0);
    const double vx = mju_dot3(velocity + 3, along), vy = mju_dot3(velocity + 3, aside), vz = mju_dot3(velocity + 3, up);
    const double r = m->radius[i], rim = r * d->qvel[m->base_dofs + i], fast = fmax(fabs(rim), fabs(vx));
    const double sinkage = (height - hub[2]) / size + r;

    const double felt = o->slip[i];
    o->slip[i] = clamp((o->slip[i] + dt / m->relaxation[i] * (rim - vx)) / (1.0 + dt / m->relaxation[i] * fast), -1.0, 1.0);
    o->aside[i] = (o->aside[i] + dt * vy) / (1.0 + dt * fast / m->lateral_length);
    memset(c, 0, sizeof *c);
    c->hub = vx;
    c->sinkage = sinkage;
    if (sinkage <= 0.0) return;
    double stress[SP_VALUES] = {0.0}, lateral = 0.0, digging = 0.0;
    for (int k = 0; k < m->soils; k++)
        if (shares[k] > 0.0) {
            look_up(&m->soil[k], i, fmin(sinkage, 0.95 * r), o->slip[i], o->dug[i], shares[k], stress);
            lateral += shares[k] * m->soil[k].lateral;
            digging += shares[k] * m->soil[k].digging_length;
        }
    o->dug[i] = (o->dug[i] + dt * fast / digging * fabs(o->slip[i])) / (1.0 + dt * fast / digging);
    const double stiff = 1.0 + field_at(&m->stiffness, hub[0], hub[1], 0, 0);
    const double strong = stiff * (1.0 + field_at(&m->strength, hub[0], hub[1], 0, 0));
    const double pressed = stiff * stress[0] + strong * stress[1];
    c->load = fmax(0.0, pressed - m->normal_damping[i] * vz);
    const double ratio = pressed > 0.0 ? c->load / pressed : 0.0; /* stresses follow the load that damping adds or takes */
    const double damping = m->shear_damping[i] * clamp(c->load / (m->mass * 9.8 / m->wheels), 0.0, 2.0);
    const double yielding = damping * m->relaxation[i] * (o->slip[i] - felt) / dt; /* none in steady slip */
    const double tangential = strong * ratio * stress[2] + yielding, thrust = strong * ratio * stress[3] + yielding;
    /* The soil heaps up before the wheel over a short travel and holds it back in the direction it moves, or wants to move. */
    const double heap = 0.3 * m->relaxation[i], full = tangential - thrust + stiff * ratio * stress[4];
    const double pushed = o->pushed[i];
    o->pushed[i] = clamp(pushed + dt * vx / heap, -1.0, 1.0);
    const double settling = 0.5 * sqrt(fabs(full) / heap * m->mass / m->wheels) * heap * (o->pushed[i] - pushed) / dt;
    c->resistance = full * o->pushed[i] + settling;
    c->mu = c->load > 0.0 ? tangential / c->load : 0.0;
    /* Deeper than the tables the belly lies on the ground, which bears it and rubs. */
    const double belly = fmax(0.0, sinkage - 0.85 * r) / (0.05 * r) * m->mass * 9.8 / m->wheels;
    const double rubbed = 0.6 * belly * clamp(vx / (0.1 * m->rest_speed + 0.01), -1.0, 1.0);
    c->resistance += rubbed;
    const double used = clamp(c->mu / (1.2 * lateral), -1.0, 1.0);
    const double sideways = -lateral * c->load * (1.0 - exp(-fabs(o->aside[i]) * 4.0 / m->lateral_length)) *
                            sqrt(fmax(0.1, 1.0 - used * used)) * (o->aside[i] < 0 ? -1.0 : 1.0);
    const double rolling = r * m->tire_resistance * c->load * clamp(rim / m->rest_speed, -1.0, 1.0);
    double *applied = d->xfrc_applied + 6 * body, arm[3], moment[3], side_force[3];
    for (int k = 0; k < 3; k++) {
        applied[k] = (tangential - c->resistance) * along[k] + sideways * aside[k] + (c->load + belly) * up[k];
        side_force[k] = sideways * aside[k];
        arm[k] = -(r - sinkage) * up[k];
    }
    mju_cross(moment, arm, side_force);
    /* The wheel's axle is the body's left: rolling forward is positive about it. */
    for (int k = 0; k < 3; k++) applied[3 + k] = moment[k] - (r * tangential + rolling) * left[k];
    *forward_normal += c->load * mju_dot3(up, ahead);
}

static void tow(const sp_machine *m, memory *o, mjData *d, double speed, double dt) {
    const double *frame = d->xmat + 9 * m->chassis_body;
    double point[3], force[3], moment[3];
    o->at_draught = after(m->draught_at, m->draughts, o->at_draught, o->travel);
    const double draught = between(m->draught_at, m->draught, m->draughts, o->at_draught, o->travel);
    const double asked = draught * (1.0 + m->draught_speed * fabs(speed)) * clamp(speed / m->draught_floor, 0.0, 1.0);
    o->pull += (1.0 - exp(-dt / m->draught_lag)) * (asked - o->pull);
    for (int k = 0; k < 3; k++) force[k] = -o->pull * frame[3 * k]; /* along the body, as its drawbar cell reads it */
    mju_mulMatVec3(point, frame, m->hitch);
    mju_cross(moment, point, force);
    for (int k = 0; k < 3; k++) {
        d->xfrc_applied[6 * m->chassis_body + k] += force[k];
        d->xfrc_applied[6 * m->chassis_body + 3 + k] += moment[k];
    }
}

/* Steps `first` to `last`; steps before 0 settle the machine on the ground, motors off. */
static int32_t advance(const mjModel *model, mjData *d, const sp_machine *m, memory *o, int32_t first, int32_t last, int32_t stride,
                       double *trace) {
    const double dt = model->opt.timestep;
    const int n = m->wheels, width = SP_SCALARS + n * SP_PER_WHEEL, base = m->base_dofs;
    int32_t rows = 0;
    for (int32_t step = first; step <= last; step++) {
        const double time = step * dt;
        mj_step1(model, d);
        const double *frame = d->xmat + 9 * m->chassis_body;
        double velocity[6], body_velocity[6];
        mj_objectVelocity(model, d, mjOBJ_BODY, m->chassis_body, velocity, 0);
        mj_objectVelocity(model, d, mjOBJ_BODY, m->chassis_body, body_velocity, 1);
        const double speed = body_velocity[3];
        if (step > 0) o->travel += dt * fabs(speed);
        double off = 1.0, shares[SP_SOILS] = {0.0}, forward_normal = 0.0;
        contact c[SP_WHEELS];
        memset(d->xfrc_applied, 0, 6 * (size_t)model->nbody * sizeof(double));
        if (step >= 0) off = control(m, o, d, time, dt);
        for (int i = 0; i < n; i++) d->qfrc_applied[base + i] = o->torque[i];
        o->at_mix = after(m->mix_at, m->mixes, o->at_mix, o->travel);
        for (int i = 0; i < n; i++) {
            const double at = o->travel + m->ahead[i];
            const int32_t k = after(m->mix_at, m->mixes, o->at_mix, at);
            const double w = k + 1 < m->mixes ? clamp((at - m->mix_at[k]) / (m->mix_at[k + 1] - m->mix_at[k]), 0.0, 1.0) : 0.0;
            const int32_t next = k + 1 < m->mixes ? k + 1 : k;
            for (int s = 0; s < m->soils; s++) shares[s] = (1.0 - w) * m->mix[k * m->soils + s] + w * m->mix[next * m->soils + s];
            stand(m, o, model, d, shares, i, dt, &c[i], &forward_normal);
        }
        tow(m, o, d, speed, dt);
        if (step >= 0 && step % stride == 0) {
            double *row = trace + (int64_t)width * rows++, outside[3] = {0.0}, load = 0.0, resisting = 0.0;
            for (int b = 1; b < model->nbody; b++)
                for (int k = 0; k < 3; k++) outside[k] += d->xfrc_applied[6 * b + k];
            double specific[3];
            mju_mulMatTVec3(specific, frame, outside);
            for (int k = 0; k < 3; k++) specific[k] /= m->mass;
            for (int i = 0; i < n; i++) {
                load += c[i].load;
                resisting += c[i].resistance;
            }
            row[0] = time;
            row[1] = d->xipos[3 * m->chassis_body];
            row[2] = d->xipos[3 * m->chassis_body + 1];
            row[3] = speed;
            row[4] = specific[0] - 9.80665 * frame[6] + body_velocity[2] * body_velocity[4] - body_velocity[1] * body_velocity[5];
            row[5] = o->pull;
            for (int k = 0; k < 3; k++) {
                row[6 + k] = specific[k];
                row[9 + k] = body_velocity[k];
            }
            row[12] = asin(clamp(frame[6], -1.0, 1.0));
            row[13] = asin(clamp(frame[7], -1.0, 1.0));
            row[14] = atan2(frame[3], frame[0]);
            row[15] = o->travel;
            row[16] = shares[m->soils - 1];
            row[17] = load;
            row[18] = resisting;
            row[19] = forward_normal;
            row[20] = off;
            row[21] = body_velocity[4];
            for (int i = 0; i < n; i++) {
                double *wheel = row + SP_SCALARS + i * SP_PER_WHEEL;
                wheel[0] = d->qvel[base + i];
                wheel[1] = o->torque[i];
                wheel[2] = c[i].mu;
                wheel[3] = c[i].load;
                wheel[4] = c[i].resistance;
                wheel[5] = c[i].hub;
                wheel[6] = c[i].sinkage;
                wheel[7] = o->slip[i];
                wheel[8] = o->dug[i];
            }
        }
        mj_step2(model, d);
        double sum = 0.0;
        for (int k = 0; k < model->nv; k++) sum += d->qvel[k];
        if (!isfinite(sum) || fabs(sum) > 1e6) return -rows - 1;
    }
    return rows;
}

int32_t sp_run(void *model, void *data, const sp_machine *m, double settle, int32_t steps, int32_t stride, double *trace) {
    memory o;
    memset(&o, 0, sizeof o);
    const int32_t before = (int32_t)(settle / ((const mjModel *)model)->opt.timestep);
    return advance((const mjModel *)model, (mjData *)data, m, &o, -before, steps, stride, trace);
}

int32_t sp_begin(void *model, void *data, const sp_machine *m, double settle, sp_memory *o) {
    memset(o, 0, sizeof *o);
    const int32_t before = (int32_t)(settle / ((const mjModel *)model)->opt.timestep);
    return advance((const mjModel *)model, (mjData *)data, m, o, -before, -1, 1, 0);
}

int32_t sp_continue(void *model, void *data, const sp_machine *m, sp_memory *o, int32_t steps, int32_t stride, double *trace) {
    const int32_t first = o->step;
    o->step += steps;
    return advance((const mjModel *)model, (mjData *)data, m, o, first, first + steps - 1, stride, trace);
}
