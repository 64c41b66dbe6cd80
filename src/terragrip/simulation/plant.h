/* The simulated machine: one to four axles, up to eight wheels, up to two tools on slack tow bars. C99, no allocation, no globals.
 *
 * One call integrates one drive and writes a trace. Fields along the path (soil, resistance, elevation, slope) are
 * plain arrays on a regular grid, made in Python. Wheels stand in the order of the axles, front to rear.
 * Tracks: 0 left, 1 right. SI units. Equations: docs/simulation.md.
 */
#ifndef TERRAGRIP_PLANT_H
#define TERRAGRIP_PLANT_H
#include <stdint.h>

/* cdef begin */
#define PLANT_WHEELS 8 /* at most */
#define PLANT_AXLES 4
#define PLANT_STATES 52 /* at most: 5 wheels + 2 + axles + 6 */

typedef enum {
    PLANT_OK = 0,
    PLANT_BAD_ARGUMENT = 1,
    PLANT_NOT_FINITE = 2 /* the state left the finite numbers */
} plant_status;

/* A row of the trace: PLANT_SCALARS single columns; then, for each plant_axle_column, one column an axle; then, for each
 * plant_wheel_column, one column a wheel. */
typedef enum {
    PLANT_TIME = 0,
    PLANT_POSITION,      /* rear axle along the path, m */
    PLANT_SPEED,         /* m/s */
    PLANT_ACCELERATION,  /* dv/dt, m/s^2 */
    PLANT_DRAWBAR,       /* N, backward pull positive */
    PLANT_SLOPE,         /* large-scale slope of the path at the centre of gravity, rad */
    PLANT_GRADIENT_FORCE, /* N, what roughness adds to m g sin(slope) */
    PLANT_ASSIST,        /* N, the operator's push */
    PLANT_BODY_PITCH,    /* rad, relative to the large-scale slope, nose up */
    PLANT_BODY_PITCH_RATE,
    PLANT_HEAVE_ACCELERATION, /* m/s^2 */
    PLANT_CURVATURE,     /* 1/m, left turn positive */
    PLANT_DRIVER_MODE,
    PLANT_COMMAND,       /* rad/s, speed command of the first wheel, straight ahead; NaN while the motors are off */
    PLANT_TOOL1_POSITION,
    PLANT_TOOL1_SPEED,
    PLANT_TOOL1_DRAUGHT, /* N */
    PLANT_TOOL2_POSITION,
    PLANT_TOOL2_SPEED,
    PLANT_TOOL2_DRAUGHT,
    PLANT_BAR2,          /* N, force in the second bar */
    PLANT_SPOT1,         /* m, where the first soft spots came to lie (NaN: not yet) */
    PLANT_SPOT2,
    PLANT_SPOT3,
    PLANT_SCALARS
} plant_column;

typedef enum {
    PLANT_AXLE_LOAD = 0, /* N, without roughness (physics.md 3) */
    PLANT_RESISTANCE,    /* rolling resistance force over that load */
    PLANT_AXLE_COLUMNS
} plant_axle_column;

typedef enum {
    PLANT_WHEEL_SPEED = 0,
    PLANT_TORQUE,
    PLANT_SLIP,
    PLANT_ADHESION,   /* F_h / F_z */
    PLANT_LOAD,       /* N, wheel load */
    PLANT_HUB_SPEED,
    PLANT_GRADIENT,   /* of the ground under the wheel */
    PLANT_HEIGHT,     /* m, corner displacement */
    PLANT_WHEEL_ACCELERATION,
    PLANT_WHEEL_COLUMNS
} plant_wheel_column;

typedef struct { /* the ground along the path, sampled every `spacing` m from `start` */
    int32_t count;
    double start, spacing;
    int32_t soils;
    int32_t curve_intervals;        /* each soil's curve on |s| = 0..1 */
    const double *curve;            /* [soil][interval + 1][2]: adhesion and its slope */
    const int32_t *soil_from[2];    /* per track: the soil, */
    const int32_t *soil_to[2];      /* the soil it changes to, */
    const double *blend[2];         /* and how much of it already (0..1) */
    const double *adhesion_scale[2]; /* spatial variation of adhesion, mean 1 */
    const double *resistance[2];    /* rho_s */
    const double *slip_resistance[2]; /* added rho_s per unit of slip */
    const double *elevation[2];     /* m, as the tyre envelops it */
    const double *gradient[2];      /* d elevation / d x */
    const double *slope;            /* rad */
    const double *curvature;        /* 1/m */
    const double *load_variation[8]; /* per wheel: relative, on top of what roughness does to its load; NULL: none */
} plant_ground;

typedef struct {
    double mass;
    double length;          /* from the point in front that it hangs on, m */
    double bar_slack;       /* total play, m */
    double bar_stiffness;   /* N/m */
    double bar_damping;     /* N s/m, acts in contact only */
    double draught_speed;   /* relative growth of draught per m/s */
    double shear_length;    /* m, travel over which draught builds up */
    const double *friction; /* on the ground's grid: draught / weight */
    const double *dig_in;   /* N, draught that does not go with weight */
} plant_tool;

typedef struct { /* a place where the wheels sink; triggered by time or lying at `position` */
    double position;        /* m, centre; NaN: comes to lie `ahead` of the axle it holds at `time` */
    double time;
    double ahead;
    double length;
    double edge;            /* share of the length over which it begins, and ends: 0..0.5 */
    double resistance[4];   /* added rho_s, by axle */
    double sinkage;         /* what full slip-sinkage adds to that, relative */
    double sinkage_length;  /* m of the rim's travel over which sinkage follows |slip| */
    double loosening;       /* the slip that an adhesion takes grows to 1 + this of itself */
    double adhesion_loss;   /* 0..1 */
    double adhesion_fall;   /* adhesion lost besides at full slip-sinkage: a curve that peaks and falls */
    double wear;            /* m of wheel slippage over which it falls to 1/e, ground away; 0: never */
} plant_spot;

typedef struct {
    int32_t enabled;
    double stuck_ratio;     /* v below this share of the command: something is wrong */
    double patience;        /* s before the driver acts */
    double boost, boost_time; /* first more speed, */
    double ease, ease_time; /* then less, */
    double assist_rate, assist_limit; /* then somebody pushes: N/s, N */
    double free_ratio, free_time; /* v above this share for this long: free again */
} plant_driver;

typedef struct {
    double mass, gravity, rear_to_cg, cg_height, hitch_height, hitch_overhang;
    int32_t axles, wheels;
    double axle_position[4];  /* m ahead of the rear axle, falling to 0 */
    double axle_share[4];     /* of the weight, at rest on level ground */
    double axle_lever[4];     /* 1/m, load gained per N m of nose-down moment */
    double wheel_share[8];    /* of the axle's load, */
    double lateral_share[8];  /* s^2/m, less this per m/s^2 to the left */
    int32_t wheel_axle[8], wheel_track[8], driven[8];
    double side[8];           /* m left of the middle */
    double radius[8], inertia[8], bearing[8];
    double command_ratio[8];  /* this wheel's speed command over the first wheel's */
    int32_t steers;           /* 1: in a curve each side is commanded the speed of its own track */
    double tire_resistance;
    double tire_stiffness, tire_damping;  /* a wheel, N/m and N s/m */
    double warp[64];                      /* N/m, [wheel][wheel]: what the chassis' stiffness makes of corner heights */
    double resistance_length;             /* m, travel over which rolling resistance builds up */
    double slip_speed;                    /* m/s: below it slip is taken over this speed */
    double load_softening;                /* adhesion at a slip goes as load^-load_softening, 1 at the static load */
    double wheel_rest_speed;              /* rad/s: tyre and bearing resistance reach full size here */
    double speed_gain, speed_integral, motor_lag, antiwindup_time, torque_limit, power_limit;
    int32_t tools;
    plant_tool tool[2];
    int32_t spots;
    plant_spot spot[8];
    plant_driver driver;
    int32_t commands;          /* wheel-speed command: linear between the points */
    const double *command_time;
    const double *command;     /* rad/s; NaN at a point: motors off until the next point */
} plant_machine;

typedef struct { /* a drive between two pieces of it */
    double state[PLANT_STATES];
    double conduct[64]; /* the plant's own: what changes seldom */
    int64_t steps;      /* done */
    int32_t ended;      /* 1: the path ended */
} plant_memory;

/* Integrate from rest at `position` (rear axle) for `steps` steps of `step` s; every `stride` steps, first at time 0, a row
 * of plant_columns() values goes to `trace` (steps / stride + 1 rows). Stops where the path ends: `rows` tells how many. */
int32_t plant_columns(const plant_machine *machine);
plant_status plant_run(const plant_machine *machine, const plant_ground *ground, double position, double step, int32_t steps,
                       int32_t stride, double *trace, int32_t *rows);
/* The same in pieces, for a controller that sets `command` between them: begin, then continue by `steps` at a time; rows are
 * written at the instants before a step. */
plant_status plant_begin(const plant_machine *machine, const plant_ground *ground, double position, plant_memory *memory);
plant_status plant_continue(const plant_machine *machine, const plant_ground *ground, plant_memory *memory, double step,
                            int32_t steps, int32_t stride, double *trace, int32_t *rows);
/* d state / dt with the driver passive and the command at `time`: for tests against another integrator. State, packed (n
 * wheels): n wheel speeds, v, n torques, n controller sums, n corner displacements and their n rates, position, the rolling
 * resistance ratio of each axle, and of each of two tools position, speed and draught. */
plant_status plant_derivative(const plant_machine *machine, const plant_ground *ground, double time, const double *state,
                              double *derivative);
plant_status plant_start(const plant_machine *machine, const plant_ground *ground, double position, double *state);
/* cdef end */
#endif
