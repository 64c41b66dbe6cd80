/* Inside the plant: what its files share. The plant's state stands at OMEGA..TOOL; `n` is the number of wheels, `m` the machine. */
#ifndef TERRAGRIP_PLANT_INSIDE_H
#define TERRAGRIP_PLANT_INSIDE_H
#include "plant.h"

#include <math.h>
#include <string.h>

#define OMEGA 0
#define V (n)
#define TORQUE (n + 1)
#define SUM (2 * n + 1)
#define Z (3 * n + 1)
#define ZDOT (4 * n + 1)
#define X (5 * n + 1)
#define RHO (5 * n + 2)
#define TOOL (5 * n + 2 + m->axles)

typedef enum { NORMAL = 0, BOOST = 1, EASE = 2, ASSIST = 3 } plant_mode;

typedef struct { /* what changes seldom: the driver and where soft spots came to lie */
    int32_t mode;
    double mode_since, trouble_since, free_since, assist;
    double spot_position[8], spot_left[8]; /* where each soft spot lies, and how much of it is left */
    double sunk[8][PLANT_AXLES];           /* slip-sinkage of each axle in it, 0..1 */
    int32_t command_index;
} conduct;

/* It fits where plant_memory keeps it. */
typedef char conduct_fits[sizeof(conduct) <= sizeof(((plant_memory *)0)->conduct) ? 1 : -1];

typedef struct { /* what one evaluation found, besides the derivative */
    double acceleration, bar[2], slope, gradient_force, curvature, lift;
    double command;
    double slip[PLANT_WHEELS], adhesion[PLANT_WHEELS], load[PLANT_WHEELS], hub[PLANT_WHEELS], gradient[PLANT_WHEELS];
    double spring[PLANT_WHEELS]; /* N, what carries the corner */
    double axle_load[PLANT_AXLES], resistance[PLANT_AXLES], draught[2];
    double pull, spin, critical[PLANT_AXLES]; /* sums over the wheels: mu F_z, J d omega/dt; mean resistance ratio at full build-up */
    /* arrow Jacobian: d omega'_i / d omega_i, d omega'_i / d v, d v' / d omega_i, d v' / d v */
    double ww[PLANT_WHEELS], wv[PLANT_WHEELS], vw[PLANT_WHEELS], vv;
} findings;

typedef struct { /* between two samples along the path */
    int32_t i;
    double w;
} place;

static inline double clamp(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

static inline place locate(const plant_ground *g, double x) {
    const double last = (double)(g->count - 1) - 1e-9;
    double u = (x - g->start) / g->spacing;
    u = u > 0.0 ? (u < last ? u : last) : 0.0; /* NaN stays inside the arrays too */
    place p;
    p.i = (int32_t)u;
    p.w = u - p.i;
    return p;
}

static inline double at(const double *field, place p) { return field[p.i] + p.w * (field[p.i + 1] - field[p.i]); }

/* plant_forces.c: d state/dt, and what was found on the way. */
void plant_derive(const plant_machine *m, const plant_ground *g, const conduct *c, double time, const double *y, double *dy, findings *f);
double plant_friction(double limit, double held, double speed, double length, double *rate);

/* plant_drive.c: motors, tow bars and tools. */
void plant_control(const plant_machine *m, const double *y, double command, double curvature, double *dy);
void plant_tools(const plant_machine *m, const plant_ground *g, const double *y, double *dy, findings *f);

/* plant_conduct.c: the driver, and what soft spots become under the wheels. */
void plant_settle(const plant_machine *m, conduct *c);
void plant_conduct(const plant_machine *m, conduct *c, double time, double h, const double *y);
void plant_follow_command(const plant_machine *m, conduct *c, double time);
double plant_command(const plant_machine *m, const conduct *c, double time);
double plant_spot_share(const plant_machine *m, const conduct *c, int32_t k, double x);
#endif
