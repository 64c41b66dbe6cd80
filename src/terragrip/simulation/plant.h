/* The simulated robot: two axles, four wheels, up to two tools on slack tow bars. C99, no allocation, no globals.
 *
 * One call integrates one drive and writes a trace. Fields along the path (soil, resistance, elevation, slope) are
 * plain arrays on a regular grid, made in Python. Wheel order: front left, front right, rear left, rear right.
 * Tracks: 0 left, 1 right. SI units. Equations: docs/simulation.md.
 */
#ifndef TERRAGRIP_PLANT_H
#define TERRAGRIP_PLANT_H
#include <stdint.h>

/* cdef begin */
#define PLANT_STATES 30
#define PLANT_COLUMNS 63

typedef enum {
    PLANT_OK = 0,
    PLANT_BAD_ARGUMENT = 1,
    PLANT_NOT_FINITE = 2 /* the state left the finite numbers */
} plant_status;

/* Columns of the trace; where a column is one of four, the wheels stand in order. */
typedef enum {
    PLANT_TIME = 0,
    PLANT_POSITION = 1,      /* rear axle along the path, m */
    PLANT_SPEED = 2,         /* m/s */
    PLANT_ACCELERATION = 3,  /* dv/dt, m/s^2 */
    PLANT_DRAWBAR = 4,       /* N, backward pull positive */
    PLANT_SLOPE = 5,         /* large-scale slope of the path at the centre of gravity, rad */
    PLANT_GRADIENT_FORCE = 6, /* N, what roughness adds to m g sin(slope) */
    PLANT_ASSIST = 7,        /* N, the operator's push */
    PLANT_BODY_PITCH = 8,    /* rad, relative to the large-scale slope, nose up */
    PLANT_BODY_PITCH_RATE = 9,
    PLANT_HEAVE_ACCELERATION = 10, /* m/s^2 */
    PLANT_CURVATURE = 11,    /* 1/m, left turn positive */
    PLANT_DRIVER_MODE = 12,
    PLANT_COMMAND = 13,      /* rad/s, wheel-speed command; NaN while the motors are off */
    PLANT_LOAD_FRONT = 14,   /* N, axle load without roughness (PHYSICS 3) */
    PLANT_RESISTANCE_FRONT = 15, /* rolling resistance force over that load */
    PLANT_RESISTANCE_REAR = 16,
    PLANT_TOOL1_POSITION = 17,
    PLANT_TOOL1_SPEED = 18,
    PLANT_TOOL1_DRAUGHT = 19, /* N */
    PLANT_TOOL2_POSITION = 20,
    PLANT_TOOL2_SPEED = 21,
    PLANT_TOOL2_DRAUGHT = 22,
    PLANT_BAR2 = 23,         /* N, force in the second bar */
    PLANT_WHEEL_SPEED = 24,
    PLANT_TORQUE = 28,
    PLANT_SLIP = 32,
    PLANT_ADHESION = 36,     /* F_h / F_z */
    PLANT_LOAD = 40,         /* N, wheel load */
    PLANT_HUB_SPEED = 44,
    PLANT_GRADIENT = 48,     /* of the ground under the wheel */
    PLANT_HEIGHT = 52,       /* m, corner displacement */
    PLANT_WHEEL_ACCELERATION = 56,
    PLANT_SPOT1 = 60,        /* m, where the first soft spots came to lie (NaN: not yet) */
    PLANT_SPOT2 = 61,
    PLANT_SPOT3 = 62
} plant_column;

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
    double resistance[2];   /* added rho_s, front and rear */
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
    double mass, gravity, wheelbase, rear_to_cg, cg_height, hitch_height, hitch_overhang, track;
    double radius[4], inertia[4], bearing[4];
    int32_t driven[4];
    double tire_resistance;
    double tire_stiffness, tire_damping;  /* a wheel, N/m and N s/m */
    double chassis_torsion;               /* N at each wheel per m of warp (fl - fr - rl + rr) */
    double resistance_length;             /* m, travel over which rolling resistance builds up */
    double slip_speed;                    /* m/s: below it slip is taken over this speed */
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

/* Integrate from rest at `position` (rear axle) for `steps` steps of `step` s; every `stride` steps, first at time 0, a row
 * of PLANT_COLUMNS values goes to `trace` (steps / stride + 1 rows). Stops where the path ends: `rows` tells how many. */
plant_status plant_run(const plant_machine *machine, const plant_ground *ground, double position, double step, int32_t steps,
                       int32_t stride, double *trace, int32_t *rows);
/* d state / dt with the driver passive and the command at `time`: for tests against another integrator. State: wheel
 * speeds 0-3, v 4, torques 5-8, controller sums 9-12, corner displacements 13-16 and their rates 17-20, position 21,
 * rolling resistance ratios 22-23, tools: position, speed, draught 24-26 and 27-29. */
plant_status plant_derivative(const plant_machine *machine, const plant_ground *ground, double time, const double *state,
                              double *derivative);
plant_status plant_start(const plant_machine *machine, const plant_ground *ground, double position, double *state);
/* cdef end */
#endif
