/* Terragrip kernel: traction estimation for wheeled machines. C99, no allocation, no globals, no I/O.
 *
 * Two layers. The filter (tg_filter_*) is the Kalman filter of physics.md 1 and 6 for one machine. The estimator
 * (tg_estimator_*) takes raw samples with missing channels and gives traction estimates: it adds vertical loads, input
 * noise, standstill, gaps, soft outlier weighting and the considered constants. Both are plain data, of a size that depends on the policy
 * (tg_filter_size, tg_estimator_size): storage need be no larger, and a copy of that many bytes is a clone.
 *
 * State order, n wheels:  x = (omega_1..omega_n, v, mu_1..mu_n, rho_s), nx = 2n+2.
 * Channel order:          y = (omega_1..omega_n, v, a_x), ny = n+2. A NaN channel is missing at that instant.
 * Matrices are row-major, nx by nx. SI units.
 *
 * A function that can fail returns a tg_status. On any status but TG_OK the object is unchanged and outputs are not written, bit for bit
 * (kernel/tests/promises.c). Only tg_estimator_block and tg_estimator_record, which go through many rows, stop at the row that is refused:
 * the object and the outputs are then as after the rows before it. Without a status: sizes and lengths (0 where an argument is out of
 * range), defaults, and tg_curve_std (NaN of a null pointer). Places of an output that belong to no wheel, axle or state of the machine, or
 * that the method does not give, are NaN in a tg_estimate and 0 in a tg_step.
 */
#ifndef TERRAGRIP_H
#define TERRAGRIP_H
#include <stddef.h>
#include <stdint.h>

#define TG_MAX_WHEELS 8
#define TG_MAX_STATES 18
#define TG_MAX_CHANNELS 10
#define TG_MODES 4
#define TG_MAX_CONSIDERED 16
/* Bytes, aligned as a double, that hold a tg_estimator: storage without malloc. Of any policy, of TG_FIXED; of filters: end of this file. */
#define TG_ESTIMATOR_ROOM 81920
#define TG_ESTIMATOR_ROOM_FIXED 43008

/* A program and its kernel must agree on the precision: whoever includes this header asks the linker for the symbol of its own. */
#ifdef TG_FLOAT
#define TG_REAL float
#define TG_PRECISION tg_kernel_in_single_precision
#else
#define TG_REAL double
#define TG_PRECISION tg_kernel_in_double_precision
#endif
#ifdef __cplusplus
extern "C" {
#endif
extern const int TG_PRECISION;
#ifdef __GNUC__
static const int *const tg_precision_check __attribute__((used)) = &TG_PRECISION;
#endif

/* cdef begin */
typedef TG_REAL tg_real;

typedef enum {
    TG_OK = 0,
    TG_BAD_ARGUMENT = 1,  /* a null pointer, a count or a constant out of range */
    TG_NOT_FINITE = 2,    /* an infinite or NaN value where a number is needed */
    TG_NOT_POSITIVE = 3,  /* a variance, load or covariance that is not positive (definite) */
    TG_TIME_REVERSED = 4, /* dt or time runs back */
    TG_DIVERGED = 5,      /* the step would leave the finite numbers */
    TG_BAD_SNAPSHOT = 6   /* not a snapshot, of another version or precision, or damaged */
} tg_status;

typedef enum { TG_EXACT = 0, TG_UNSCENTED = 1 } tg_engine;
typedef enum { TG_FIXED = 0, TG_ADAPTIVE = 1, TG_SUPERVISED = 2, TG_BANK = 3 } tg_policy;

typedef struct { /* constants of the machine */
    int32_t wheels;                 /* 1..8 */
    tg_real mass;                   /* kg */
    tg_real gravity;                /* m/s^2 */
    tg_real tire_rolling_resistance; /* rho_t */
    tg_real radius[8];              /* m, torque arm = rolling unless the estimator sets another */
    tg_real inertia[8];             /* kg m^2 */
    tg_real bearing_resistance[8];  /* rho_w, N s/rad: torque r rho_w omega */
} tg_machine;

typedef struct { /* inputs held over one step */
    tg_real torque[8]; /* N m at the wheel */
    tg_real load[8];   /* N, vertical, > 0 */
    tg_real drawbar;   /* N, backward pull positive */
    tg_real slope;     /* rad, uphill positive */
    tg_real mass;      /* kg; 0: the machine's */
    tg_real hitch_load; /* N, vertical, down positive: carried by the wheels beside the weight, so that soil resistance counts on it too */
} tg_input;

typedef struct {
    int32_t engine;          /* tg_engine */
    int32_t policy;          /* tg_policy; TG_BANK needs TG_EXACT */
    tg_real walk[18];        /* Q0 as a density: variance per second of each state's random walk, state order */
    tg_real huber;           /* soft weighting beyond this many SDs of a channel's innovation; 0 = off */
    tg_real alpha, beta, kappa; /* unscented; 1, 2, 0. The centre weight must not be negative */
    tg_real rate;            /* adaptation: eta, 0.05 */
    tg_real memory;          /* adaptation: exponential memory of the innovations' products, s, 3 */
    int32_t stride;          /* adaptation: a step of A every `stride` updates, 5 */
    tg_real window;          /* supervisor: W, s, 0.5 */
    tg_real wheel_speed_min; /* supervisor: omega_min, rad/s */
    tg_real ground_speed_min; /* supervisor: v_min, m/s */
    int32_t supervisor;      /* 0: wheel-speed and ground-speed changes (paper); 1: drive-torque and slip changes */
    tg_real scales[4];       /* bank: factors on Q0, .1 1 10 100 */
    tg_real dwell;           /* bank: mean time in a mode, s */
    int32_t mix_stride;      /* bank: IMM mixing every `mix_stride` updates, 5 */
} tg_tuning;

typedef struct { /* what one update did; arrays in channel or state order, unused places 0 */
    int32_t channels;        /* how many channels were used */
    tg_real nis;             /* normalised innovation squared, with the weighted R */
    tg_real log_likelihood;
    tg_real innovation[10];  /* NaN where the channel was missing */
    tg_real innovation_variance[10]; /* prior: (H P H')_jj + R_j, before weighting */
    tg_real weight[10];      /* 1 = full trust, < 1 = softened */
    tg_real gamma;           /* supervisor, 1 for adaptive, 0 for fixed and bank */
    tg_real adaptation[18];  /* a_j used in this step */
    tg_real mode[4];         /* bank probabilities after the update */
} tg_step;

typedef struct tg_filter tg_filter;
size_t tg_filter_size(int32_t policy); /* bytes of storage that a filter of this tg_policy needs */
tg_tuning tg_default_tuning(void);
tg_status tg_filter_init(tg_filter *f, const tg_machine *machine, const tg_tuning *tuning, const tg_real *x0, const tg_real *P0);
/* Predict over dt with `before` held (Q once, at the end), then update with y. `q_input`: extra variance added to each state in this
 * step (input noise), never adapted or scaled. `r`: channel variances. `now`: the inputs at the instant of y (for a_x). */
tg_status tg_filter_step(tg_filter *f, tg_real dt, const tg_input *before, const tg_input *now, const tg_real *q_input,
                         const tg_real *y, const tg_real *r, tg_step *out);
tg_status tg_filter_predict(tg_filter *f, tg_real dt, const tg_input *before, const tg_real *q_input);
/* Keep the marginal of (mu, rho_s), add `walk_time` seconds of their random walk, and restart (omega, v) at `outputs`
 * (n+1 values) with variances `variances`, uncorrelated: standstill (walk_time 0), a long gap, a change of direction. */
tg_status tg_filter_restart(tg_filter *f, tg_real walk_time, const tg_real *outputs, const tg_real *variances);
/* Mean (nx) and covariance (nx*nx); of the bank: the mixture's. Either pointer may be null. */
tg_status tg_filter_moments(const tg_filter *f, tg_real *x, tg_real *P);
/* The sensitivities of adaptation, for tests: dP/d ln a_j, nx*nx, and dx/d ln a_j, nx. */
tg_status tg_filter_sensitivity(const tg_filter *f, int32_t j, tg_real *dx, tg_real *dP);

/* The covariance as P = U diag(D) U': U nx*nx with its rows in state order (a permuted unit triangle), D nx, all positive. `mode` is
 * the bank's, 0..3, else 0. Exact where P itself, in single precision, may round to an indefinite matrix. */
tg_status tg_filter_factors(const tg_filter *f, int32_t mode, tg_real *U, tg_real *D);

/* Considered constants (Schmidt-Kalman): constants that the data cannot determine, each with a spread. A column is d x / d p times one SD of
 * p. The reported covariance is P + sum of column column'. The columns pass through the very gains of the filter. */
typedef struct { /* what one SD of each constant adds to what the filter computes, over one step: place k of column k, 0 beyond the last */
    tg_real wheel_acceleration[8][16]; /* wheel, rad/s^2, to d omega_i/dt */
    tg_real acceleration[16];          /* m/s^2, to dv/dt */
    tg_real accelerometer[16];         /* m/s^2, to the computed a_x, less what the sensor itself reads too much */
} tg_deviations;
typedef struct tg_consider tg_consider;
size_t tg_consider_size(void);
tg_status tg_consider_init(tg_consider *c, const tg_filter *f, int32_t columns); /* columns of 0 */
/* Call after every tg_filter_step, _predict and _restart. `deviations` null: none. */
tg_status tg_consider_step(tg_consider *c, const tg_filter *f, const tg_deviations *deviations);
tg_status tg_consider_columns(const tg_consider *c, tg_real *s); /* columns by nx, state order */

/* Smoother (Rauch-Tung-Striebel). Forwards: after every tg_filter_step, _predict and _restart call tg_track_step; once a row, after at
 * most one step with an update, tg_record_take writes a record of tg_record_length reals and starts the next track. Backwards:
 * tg_record_moments at the last row, then tg_smooth_step row by row; x, P and s hold `next` when called and `here` on return. */
typedef struct tg_track tg_track;
size_t tg_track_size(void);
tg_status tg_track_init(tg_track *t, const tg_filter *f);
tg_status tg_track_step(tg_track *t, const tg_filter *f);
size_t tg_record_length(int32_t wheels, int32_t columns);
tg_status tg_record_take(tg_real *record, tg_track *t, const tg_filter *f, const tg_consider *c); /* c may be null: 0 columns */
tg_status tg_record_moments(int32_t wheels, int32_t columns, const tg_real *record, tg_real *x, tg_real *P, tg_real *s);
tg_status tg_smooth_step(int32_t wheels, int32_t columns, const tg_real *here, const tg_real *next, tg_real *x, tg_real *P, tg_real *s);

/* ---- The adhesion curve while driving (paper, Fig. 2): a of mu = a g(s), g the paper's prototype (physics.md 5), from single pairs. ---- */

typedef struct {
    tg_real a;
    tg_real variance; /* of a, random errors only */
    tg_real constant; /* by how much one SD of what stays constant in the pairs moves a */
    tg_real surprise; /* mean square of recent residuals in their variances: 1 on one ground */
    tg_real adhesion, height; /* mean mu and g(s) of recent pairs */
    tg_real silence;  /* s since the last pair; negative: none yet */
} tg_curve;
typedef struct {
    tg_real adhesion, slip;
    tg_real adhesion_variance, slip_variance; /* random errors */
    tg_real adhesion_constant;                /* SD of the constant error of mu */
    tg_real radius_error;                     /* relative SD of the rolling radius: shifts mu and slip */
} tg_pair;
tg_curve tg_curve_unknown(void); /* also: a new ground */
/* `pairs` of one instant, weighted by `share` (> 0; load), dt s and `distance` m after the last. A pair with a NaN or a slip above 60 %
 * teaches nothing, nor do pairs whose mean is below g(5 %); residuals too large for one ground restart a. */
tg_status tg_curve_update(tg_curve *c, tg_real dt, tg_real distance, int32_t pairs, const tg_pair *pair, const tg_real *share);
tg_real tg_curve_std(const tg_curve *c); /* of a, random and constant errors */

/* ---- Estimator: one raw sample in, one row of estimates out. A whole recording is its samples, one after another. ---- */

/* Places of a sample's channels. Wheels and axles in the vehicle's order, front to rear, left to right. */
enum {
    TG_WHEEL_SPEED = 0,      /* + wheel, rad/s */
    TG_GROUND_SPEED = 8,     /* m/s */
    TG_DRIVE_TORQUE = 9,     /* + wheel, N m at the wheel */
    TG_DRAWBAR_FORCE = 17,   /* N, backward pull positive */
    TG_ACCELERATION_X = 18,  /* m/s^2, specific force */
    TG_ACCELERATION_Y = 19,  /* m/s^2, specific force, left positive */
    TG_PITCH = 20,           /* rad, nose up positive */
    TG_ROLL = 21,            /* rad, left side up positive */
    TG_VERTICAL_LOAD = 22,   /* + axle, N */
    TG_YAW_RATE = 30,        /* rad/s, to the left positive */
    TG_MASS = 31,            /* kg, of the whole machine, where tanks or hoppers change it */
    TG_HITCH_LOAD = 32,      /* N, what hangs on the hitch presses down on it */
    TG_BRAKE = 33,           /* share, 0 released to 1: beyond a small part of it a brake acts on the wheels that no torque shows */
    TG_SLOTS = 36            /* whole lanes; the last ones are not used */
};

/* Places of an estimate's values. Each `_STD` holds the considered constants. */
enum {
    TG_OUT_GROUND_SPEED = 0,
    TG_OUT_GROUND_SPEED_STD = 1,
    TG_OUT_SOIL_RESISTANCE = 2,
    TG_OUT_SOIL_RESISTANCE_STD = 3,
    TG_OUT_NIS = 4,          /* of the channels used; 0 where none was */
    TG_OUT_CHANNELS = 5,     /* how many channels were used: the expectation of NIS */
    TG_OUT_SUPERVISOR = 6,   /* gamma; of the bank: its expected log scale, 0 at the smallest and 1 at the largest */
    TG_OUT_DISTANCE = 7,     /* m travelled since the first sample, either way */
    TG_OUT_WHEEL_SPEED = 8,  /* + wheel; so are the next ones */
    TG_OUT_WHEEL_SPEED_STD = 16,
    TG_OUT_ADHESION = 24,
    TG_OUT_ADHESION_STD = 32,
    TG_OUT_SLIP = 40,
    TG_OUT_SLIP_STD = 48,
    TG_OUT_NET_TRACTION = 56,
    TG_OUT_NET_TRACTION_STD = 64,
    TG_OUT_EFFICIENCY = 72,
    TG_OUT_EFFICIENCY_STD = 80,
    TG_OUT_VERTICAL_LOAD = 88, /* + axle */
    TG_OUT_CURVE = 96,       /* the vehicle's scale a of the adhesion curve while driving; smoothing leaves it as it was */
    TG_OUT_CURVE_STD = 97,
    TG_OUT_WHEEL_CURVE = 98, /* + wheel */
    TG_OUT_WHEEL_CURVE_STD = 106,
    TG_OUT_WARNING = 114,    /* score of the warning of immobilization, points */
    TG_OUT_USUAL_SLIP = 115, /* what the watch holds for usual */
    TG_OUT_SIGN = 116,       /* + tg_sign, points; 0 where nothing is judged */
    TG_OUT_ADAPTATION = 121, /* + state: a_j of A_k as this row used it; NaN but for the adaptive and the supervised policy */
    TG_OUT_ZERO_SLIP_RADIUS = 139, /* + wheel, m: what slip counts from; NaN but for TG_SPEEDS */
    TG_OUT_ZERO_SLIP_RADIUS_STD = 147,
    TG_OUT_CHANNEL_NIS = 155, /* + channel (wheel speeds, ground speed, a_x): each one's own; NaN where it was not measured */
    TG_OUT_SLOTS = 165
};

typedef enum {
    TG_EVENT_NONE = 0,
    TG_EVENT_OUTLIER = 1,    /* a value far from what the filter or its own past expects, given less weight */
    TG_EVENT_STANDSTILL = 2, /* slip and efficiency are undefined (NaN); adhesion and resistance are held */
    TG_EVENT_GAP = 3,        /* nothing measured for longer than `gap`, or nothing yet: values before the first are NaN; or a wheel's
                              * speed, a drive torque or the drawbar force silent for longer while others come: what depends on it is NaN */
    TG_EVENT_IMMOBILIZATION = 4, /* a warning: the wheels dig, the vehicle is about to get stuck */
    TG_EVENT_STUCK = 5,      /* the wheels turn, the vehicle hardly moves */
    TG_EVENT_PUSH = 6,       /* something pushes from behind while the wheels pull: a tool that runs up */
    TG_EVENT_RESTART = 7     /* a step of the filter left the finite numbers: it restarts from the priors at this row */
} tg_event;

typedef enum { /* signs that the wheels dig, in points; the score is their sum, low-passed */
    TG_SIGN_RISE = 0,       /* slip of the worst wheels rises */
    TG_SIGN_HIGH = 1,       /* and is high */
    TG_SIGN_LEADING = 2,    /* the leading wheels' adhesion falls against the trailing ones' */
    TG_SIGN_RESISTANCE = 3, /* the soil resistance rises */
    TG_SIGN_COMMAND = 4,    /* not above 0: the speed of the rims changes, or the vehicle gains some */
    TG_SIGNS = 5
} tg_sign;

typedef enum {
    TG_FILTERED = 0,
    TG_ALGEBRAIC = 1,
    TG_SPEEDS = 2 /* without torque: speeds, slip, distance; all other values NaN. A wheel may represent a drive train */
} tg_method;

typedef struct {
    double time;            /* s, rising */
    tg_real value[36];      /* NaN = not measured at that instant */
} tg_sample;

typedef struct {
    double time;
    double distance;
    int32_t event;          /* tg_event */
    tg_real value[165];
} tg_estimate;

typedef struct { /* spreads (1 SD) of constants that the data cannot determine; 0 = known */
    tg_real drive_torque_gain;      /* relative, each wheel its own */
    tg_real drive_torque_gain_common; /* relative, all wheels together */
    tg_real drive_torque_offset;    /* N m, each wheel its own */
    tg_real drawbar_gain;           /* relative */
    tg_real drawbar_offset;         /* N: of the zero; where none is measured (towing 0), of the pull itself */
    tg_real mass;                   /* relative, of what the loads come from: the machine's, or as it is measured */
    tg_real hitch_load_gain;        /* relative */
    tg_real hitch_load_offset;      /* N */
    tg_real slope;                  /* rad: an unmeasured slope, or the pitch sensor's mounting */
    tg_real tire_rolling_resistance;
    tg_real vertical_load;          /* relative: what the front gains, the rear loses */
    tg_real wheel_radius;           /* relative */
    tg_real acceleration_bias;      /* m/s^2 */
} tg_uncertainty;

typedef struct { /* when the estimator warns of immobilization (see src/digging.c), and calls the vehicle stuck or pushed */
    tg_real pace;                   /* the unit of time, over sqrt(length/gravity) */
    tg_real memory;                 /* units of time, low-pass of the points' sum, the score */
    tg_real usual;                  /* units of time over which what is usual is learned, */
    tg_real soon;                   /* and within which more slip than usual is: soon, and forgotten late, so that work outlasts headlands */
    tg_real ahead, beyond;          /* where sure slip passes the first, and the second times its usual, if it rises as much again in the next unit of time, */
    tg_real warn;                   /* and of a score above this; on until it is half of this */
    tg_real most;                   /* points of a sign at most; of high slip and of the command twice as many */
    tg_real change;                 /* a point: rise of slip above its mean over a unit of time, or fall of the leading wheels' share of adhesion (-1 to 1) below its usual */
    tg_real command;                /* a point off: gain of rim speed over that mean, or twice as much loss; log */
    tg_real high_slip;              /* slip beyond which points are given, `most` at twice that */
    tg_real resistance;             /* a point: rise of the soil resistance above its mean over a unit of time */
    tg_real stuck_duration;         /* s that the ground speed must stay below `stuck_travel` */
    tg_real stuck_travel, free_travel; /* ground over rim speed: below the first stuck, free again above the second */
    tg_real push, thrust;           /* push from behind, and thrust meanwhile, over the weight */
    tg_real push_duration;          /* s */
} tg_watch_settings;

/* The tuned numbers of the estimator, all but the thresholds in the settings; the effect of halving and doubling each:
 * docs/families.md. Scaled by the machine where noted: T = sqrt(r/g), r its mean wheel radius, and V = sqrt(g r). */
typedef struct {
    tg_real adhesion_walk;          /* variance of a wheel's adhesion, gained in T */
    tg_real resistance_walk;        /* variance of the soil resistance, gained in T */
    tg_real force_walk;             /* variance of the ground speed, and of a rim's, in V^2, gained in T: forces that nothing measures */
    tg_real spike;                  /* an increment of a signal beyond this many of its usual SDs is a spike until the next confirms it */
    tg_real agility;                /* of gravity: a change of speed that a vehicle can do, hence no spike */
    tg_real increment_memory;       /* s: of the usual increments */
    tg_real input_lag;              /* s, at most: low-pass of measured loads, pitch, and the pull as the loads feel it */
    tg_real unknown_slope;          /* rad: SD of a pitch never measured or long silent */
    tg_real mounting_walk;          /* rad^2, gained in T: of the slope that a pitch sensor does not show */
    tg_real terrain_walk;           /* rad^2, gained on a wheel radius of way: of the whole slope, where there is none */
    tg_real silence;                /* s without a ground speed after which it is reckoned from the wheels */
    tg_real slip_memory;            /* s over which slip and adhesion are remembered for that */
    tg_real most_slope;             /* of slip over adhesion */
    tg_real slip_apart;             /* SD of slips of one drive about the usual one, until it shows it */
    tg_real alike, carried_alike;   /* s over which the filter takes the error of a dead-reckoned speed to last; of one predicted by the accelerometer */
    tg_real reckoned_force, carried_force; /* force_walk times this beside it, meanwhile */
    tg_real shock_memory;           /* s: of what the accelerometer reads beyond the model */
    tg_real shock_samples;          /* samples that a shock lasts */
    tg_real longest_walk;           /* s of random walk that a gap adds at most: beyond it the ground is simply unknown */
    tg_real standstill;             /* V: below it a machine counts as standing */
    tg_real settle;                 /* s: low-pass of the speeds that decide standstill */
    tg_real leap;                   /* s that a ground speed above it must last to end a standstill while no wheel turns */
    tg_real unknown_torque;         /* adhesion: SD of a torque never measured or long silent */
    tg_real unknown_pull;           /* of the weight: SD of such a drawbar force */
    tg_real least_load;             /* of a wheel's load at rest: the least that is assumed */
    tg_real first_slip;             /* until the first ground speed */
    tg_real slow_share;             /* of the ground speed's noise: SD of an error that stays alike for long, */
    tg_real slow_stops;             /* as if so many stops had shown it */
    tg_real alike_memory;           /* ground speeds: over so many it is tallied how alike neighbouring innovations are, */
    tg_real alike_sure;             /* and counts beyond this many SDs of chance */
    tg_real uneven_length;          /* wheel radii: shorter changes of adhesion and resistance are the ground's unevenness */
    tg_real uneven_memory;          /* wheel radii over which their mean squares are averaged */
    tg_real uneven_most;            /* usual squares that one counts at most: a border between soils is no bump */
    tg_real slip_length;            /* wheel radii over which a wheel's slip beyond all trends is averaged, or low-passed as strongly */
    tg_real bend, bend_spread;      /* slope of the curve that wheels share over its secant, and what it may be at most */
    tg_real least_slip;             /* below it the secant of that curve is not known */
    tg_real small_slip;             /* SD of slip: a noise below it is small */
    tg_real lasting_share;          /* of what lasts beyond all trends: how likely it is adhesion, and not load */
    tg_real soil_spread;            /* relative SD of the resistance of a field's soil: variation beyond it may be slope, where nothing measures the slope; */
    tg_real hill_memory;            /* wheel radii over which its mean and its SD are averaged for that, at most */
    /* Of slip from speeds alone (TG_SPEEDS): what drivers and motors do, not scaled by the machine. */
    tg_real manoeuvre[3];           /* (m/s^2)^2/s, what the acceleration gains: a steady drive, driving by hand, sharp starts and stops */
    tg_real slipping[3];            /* 1/s, variance that slip gains: one ground and load, a rough one, a wheel that lets go */
    tg_real lasting, mode_dwell;    /* s: time constant of the acceleration; mean time in a pair of those densities */
    tg_real first_rate;             /* m/s^2, SD of the acceleration before any is known */
    tg_real slowest;                /* m/s: slower wheels change their slip speed no less */
    tg_real apart;                  /* 1 - the correlation of what two wheels' slip speeds change by: they stand on one ground and pull one load */
} tg_tuned;

typedef struct {
    int32_t method;                 /* tg_method */
    int32_t axles;                  /* 1..8 */
    int32_t towing;                 /* 1: a drawbar force is measured, so it is unknown until its first value; 0: none until then */
    int32_t weighed, carrying;      /* 1: mass, vertical hitch load are measured, likewise; 0: they are never used */
    int32_t articulated;            /* 1: it bends at a joint between axles, so that each has a rate of turn of its own */
    int32_t pivots[8];              /* axle: 1: it swings on a pin in its middle, so that its wheels carry alike */
    int32_t wheel_axle[8];          /* which axle a wheel is on */
    int32_t driven[8];              /* 0: its torque is 0 */
    int32_t powered[8];             /* 1: a motor drives it, so the watch looks at it; of no wheel: at all. A driven wheel may be merely measured */
    tg_machine machine;
    tg_tuning tuning;
    tg_real load_share[8];          /* axle: part of the weight on it at rest on level ground */
    tg_real load_transfer[8];       /* axle, 1/m: load gained per N m of nose-down moment (two axles: 1/L, -1/L) */
    tg_real payload_share[8];       /* axle: part that it carries of the mass beyond the machine's, */
    tg_real payload_height;         /* m: which has its centre of gravity there */
    tg_real hitch_share[8];         /* axle: part of the vertical hitch load, below 0 where that lifts it */
    tg_real wheel_share[8];         /* wheel: part of its axle's load */
    tg_real wheel_side[8];          /* wheel, m left of the middle: its hub moves at v - side x yaw rate */
    tg_real wheel_ahead[8];         /* steered wheel, m ahead of the axle that does not steer: it points along its hub's way; else 0 */
    tg_real receiver_ahead, receiver_side; /* m ahead of, left of what the ground speed counts for: it measures it there */
    tg_real lateral_share[8];       /* wheel, s^2/m: part of its axle's load it loses per m/s^2 to the left */
    tg_real center_of_gravity_height; /* m */
    tg_real hitch_height;           /* m */
    tg_real rolling_radius[8];      /* wheel, m: travel per radian; machine.radius is the torque arm */
    tg_real drive_friction[8];      /* wheel, N m: of motor and gears, part of the measured torque, against the wheel's turning */
    tg_real offset[36], gain[36];   /* calibration: value = (raw - offset) / gain */
    tg_real noise[36];              /* SD of each channel after calibration */
    tg_real held_period[36];        /* s; > 0: the channel repeats its last value between updates this far apart */
    tg_real ground_speed_delay;     /* s, SD: while the speed changes, its sensor is off by so much of that */
    tg_uncertainty uncertainty;
    tg_real prior_adhesion, prior_adhesion_std;     /* before the first sample */
    tg_real prior_resistance, prior_resistance_std;
    tg_real slope_spread;           /* rad: by how much the slope may differ from the measured pitch (from 0 without one) */
    tg_real standstill_speed;       /* m/s; 0: by its tuned number and the machine's size */
    tg_real dead_band;              /* m/s: TG_SPEEDS treats rims of at most this as unknown while the vehicle moves */
    tg_real gap;                    /* s without any wheel or ground speed after which the motion starts again */
    tg_real max_step;               /* s; a longer step is predicted in pieces */
    tg_real outlier_weight;         /* a channel weighted below this flags the row */
    tg_real load_filter;            /* s, low-pass of the acceleration that moves the loads */
    tg_real algebraic_filter;       /* s, low-pass of every signal of the algebraic method */
    tg_watch_settings watch;
    tg_tuned tuned;
} tg_settings;

typedef struct tg_estimator tg_estimator;
size_t tg_estimator_size(int32_t policy); /* bytes of storage that an estimator of this tg_policy needs */
/* Tuned thresholds, tuning and priors; the machine is left empty, and with it the random walks. */
tg_settings tg_default_settings(void);
/* The random walks (tuning.walk) of the machine that the settings hold, by their tuned numbers. */
tg_status tg_tune_walks(tg_settings *settings);
tg_status tg_estimator_init(tg_estimator *e, const tg_settings *settings);
tg_status tg_estimator_update(tg_estimator *e, const tg_sample *sample, tg_estimate *out);
/* The ground is another one from here on: what was learned of its adhesion curve no longer holds. */
tg_status tg_estimator_new_ground(tg_estimator *e);
/* `rows` samples from columns (a null pointer: never measured) to columns (null: not wanted); doubles on either build. `done` tells
 * how many rows went through before a status other than TG_OK. */
tg_status tg_estimator_block(tg_estimator *e, size_t rows, const double *time, const double *const *in, double *const *out,
                             uint8_t *event, size_t *done);
/* Smoothing a recording in blocks, backwards. For each block, last to first: an estimator restored to the block's start writes a record of
 * tg_smooth_length reals a row; then the rows are smoothed from the last to the first. `carry`, tg_smooth_carry reals, goes from block to
 * block; `next` is the first record of the block behind, null for the last block. Columns of the belief are written to `out`, the others
 * (nis, channels, supervisor, distance, loads) stay as the forward pass left them. Not for the algebraic method. */
size_t tg_smooth_length(const tg_estimator *e);
size_t tg_smooth_carry(const tg_estimator *e);
tg_status tg_estimator_record(tg_estimator *e, size_t rows, const double *time, const double *const *in, tg_real *records);
tg_status tg_estimator_smooth(const tg_estimator *e, size_t rows, const tg_real *records, const tg_real *next, tg_real *carry,
                              double *const *out);
/* Bytes that continue bit for bit, with this kernel's version and precision only. */
size_t tg_snapshot_size(const tg_estimator *e); /* by its policy */
tg_status tg_estimator_snapshot(const tg_estimator *e, uint8_t *bytes);
/* `room`: bytes of storage at `e`. TG_BAD_ARGUMENT where the snapshot's estimator needs more. */
tg_status tg_estimator_restore(tg_estimator *e, size_t room, const uint8_t *bytes, size_t size);
tg_status tg_estimator_settings(const tg_estimator *e, tg_settings *settings);
/* From the next sample on, these SDs and update periods of the channels (36 each, as in tg_settings); the estimate continues. */
tg_status tg_estimator_set_noise(tg_estimator *e, const tg_real *noise, const tg_real *held_period);
/* cdef end */
#ifdef __cplusplus
}
#endif

/* ---- What a filter is made of, so that C code can hold one without allocation. Read and write it by the functions above only. ----
 * Inside, states run (mu_1..mu_n, rho_s, v, omega_1..omega_n) and covariances are factors P = U D U' by columns; see src/filter.h. */
#define TG_ROWS 20       /* TG_MAX_STATES in whole lanes of four */
#define TG_SNAPSHOTS 56  /* of the supervisor's window: 50, one before it, and room */
#define TG_PAIRS 171     /* TG_MAX_STATES (TG_MAX_STATES + 1)/2 */

typedef struct { /* an affine map of the state: omega' = phi omega + b mu, v' = keep v + sum c mu - g rho, with noise q */
    tg_real phi[8], b[8], psi[8], c[8];
    tg_real keep, g, dt;
    tg_real q[TG_ROWS];
} tg_passage;

typedef struct { /* one lane a mode of the bank */
    tg_real x[TG_ROWS][TG_MODES], d[TG_ROWS][TG_MODES], u[TG_MAX_STATES][TG_ROWS][TG_MODES];
    tg_real gain[TG_MAX_CHANNELS][TG_ROWS][TG_MODES];
    tg_real probability[TG_MODES];
    double mixed;     /* clock of the last mixing */
    int32_t updates;  /* since then, that of the mixing left out */
} tg_bank_state;

typedef struct { /* sensitivities to ln a_j, one lane a parameter */
    tg_real scale[TG_ROWS];              /* a_j */
    tg_real dx[TG_MAX_STATES * TG_ROWS]; /* state by parameter, `stride` apart */
    tg_real dP[TG_PAIRS * TG_ROWS];      /* the triangle row >= column, row by row, by parameter */
    tg_real C[TG_MAX_WHEELS + 1][TG_MAX_WHEELS + 1]; /* mean product of the whitened innovations; I at first */
    int32_t updates;                     /* with every wheel and ground speed, since the last step of A */
} tg_adaptation_state;

typedef struct {
    tg_real value[TG_SNAPSHOTS][TG_MAX_WHEELS + 1]; /* rule 0: omega, v; rule 1: torque, mean slip */
    double time[TG_SNAPSHOTS];
    tg_real last[TG_MAX_WHEELS + 1];     /* last known omega, v */
    int32_t first, count;
    tg_real gamma;
} tg_supervisor_state;

struct tg_filter {
    tg_machine machine;
    tg_tuning tuning;
    int32_t wheels, states, channels, stride;
    double clock;                        /* s, the sum of dt */
    tg_real drag[8], arm[8];             /* r rho_w/J, 1/s, and r/J, 1/(kg m) */
    tg_real inverse_inertia[8], inverse_mass;
    tg_real moves[8];                    /* time over which a wheel moves in a step, over the step's: 1, but for wheels.c */
    tg_real stiffness;                   /* 1/s, largest drag */
    tg_real slope[2], cosine[2], sine[2]; /* of the last two slopes */
    tg_real walk[TG_ROWS];
    tg_real x[TG_ROWS], d[TG_ROWS], u[TG_MAX_STATES * TG_ROWS]; /* without a bank */
    tg_real P[TG_MAX_STATES * TG_ROWS];  /* instead of d and u, where `formed`, without a bank: rows `stride` apart, columns to the diagonal hold */
    int32_t formed;                      /* covariances are held, not factors */
    int32_t factor_steps;                /* still to be done with factors */
    tg_real x_prior[TG_ROWS];            /* of the last step, before its update */
    tg_passage passage;                  /* of the last step */
    int32_t used;                       /* channels of the last step, in the order used */
    int32_t channel[TG_MAX_CHANNELS];
    tg_real gain[TG_MAX_CHANNELS][TG_ROWS]; /* each after the ones before it; without a bank */
    tg_real accelerometer[TG_ROWS];      /* row of H of a_x in the last step */
    union { /* last, so that storage ends with the part that the policy uses: see tg_filter_size */
        struct {
            tg_adaptation_state adaptation; /* TG_ADAPTIVE, TG_SUPERVISED */
            tg_supervisor_state supervisor; /* TG_SUPERVISED */
        } adaptive;
        tg_bank_state bank;
    } policy;
};
#define TG_FILTER_ROOM sizeof(tg_filter)                /* of any policy */
#define TG_FILTER_ROOM_FIXED offsetof(tg_filter, policy) /* of TG_FIXED */

struct tg_consider { /* row by row, one lane a column; 0 beyond the last */
    int32_t columns, wheels, states;
    tg_real s[TG_MAX_STATES][TG_MAX_CONSIDERED], prior[TG_MAX_STATES][TG_MAX_CONSIDERED];
};

struct tg_track {
    int32_t wheels, states, used;
    tg_passage passage;                  /* composite; its q is not used */
    tg_real Q[TG_MAX_STATES * TG_MAX_STATES];
};
#endif
