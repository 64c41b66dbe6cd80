/* Inside the estimator. Signals here are calibrated; "along" means in the direction of travel (physics.md 2). */
#ifndef TG_ESTIMATOR_H
#define TG_ESTIMATOR_H
#include "curve.h"
#include "slip.h"
#include "watches.h"

typedef struct { /* an input between its samples */
    tg_real value;    /* filtered */
    tg_real variance; /* of the filtered value's noise */
    tg_real raw;      /* last sample */
    tg_real calm;     /* last sample that was no spike */
    tg_real level;    /* mean square of its increments, spikes clipped */
    tg_real interval; /* s between its last two samples, */
    tg_real rate;     /* 1/s, of the change between them */
    tg_real bend, bends; /* square of what that change is beyond the one before, over the same time; its mean */
    tg_real spike;    /* square of the last increment where that was a spike, else 0 */
    double time;      /* of the last sample, */
    double since;     /* and of the row before it: the step between the two has it, too */
    int32_t count;    /* samples seen, saturating */
} tg_hold;

typedef struct { /* a measured speed as it decides standstill and the direction of travel */
    tg_real settled, soon; /* low-passed exactly, and as little as its noise allows */
    double time;           /* of its last sample */
    int32_t seen;
} tgi_settling;

typedef struct { /* one row, calibrated and checked, in the vehicle's own directions; NaN = missing */
    double time;
    tg_real value[TG_SLOTS];
    int32_t measured; /* any wheel or ground speed */
    int32_t outlier;
    tg_real missed_braking; /* of a braked vehicle: variance of rho_s by the brake before its first sample */
    int32_t steady_wheels; /* bits: the wheel's speed is not measured but steady, with this variance, see wheels.c */
    tg_real wheel_variance[8];
    int32_t reckoned; /* the ground speed is not measured but reckoned */
    tg_real chatter[8]; /* variance of the wheel's speed by what alternates from sample to sample, see inputs.c */
    tg_real ground_variance;
    tg_real turn_variance; /* of the ground speed, by what a turn adds to it at its receiver */
    tg_real loud;          /* and by what its noise lately is beyond the one that is set, see loudness.c */
    tg_real doubt[TG_GROUND_SPEED + 1]; /* by place in a sample: variance beside the sensor's, of a spike */
    tg_real channel_nis[TG_MAX_CHANNELS]; /* NaN: no update took the channel as measured */
} tg_row;

typedef struct { /* what a row's values need beside the belief; all reals, so that it goes into a record */
    tg_real load[8]; /* wheel, N */
    tg_real hub[8];  /* wheel, m/s: what its hub is faster than the vehicle, along the travel */
    tg_real warp[8]; /* wheel: the part of its adhesion beyond all trends that is not load, see warp.c */
    tg_real doubt[8]; /* wheel: variance of an adhesion that alternates from sample to sample, or whose torque may have leapt, see doubt.c, */
    tg_real since_sample[8]; /* wheel: variance of what its speed has moved by since its last sample, see wheels.c */
    tg_real sides[8]; /* and of one by as much as the other side's is off the other way: the vehicle's forces do not contain it */
    tg_real across[8]; /* steered wheel, m/s: its hub's speed across the vehicle; else 0 */
    tg_real turn[8]; /* wheel: variance of its slip by a turn that no sensor shows */
    tg_real silent[8]; /* wheel: 2 where its speed is silent while others are measured, 1 where its drive torque is */
    tg_real any_silent; /* whether any is, or the drawbar force */
    tg_real direction, standing, seen_motion; /* standing: or else without a slip */
    tg_real bumps;     /* variance of rho_s by the gradients of uneven ground, see roughness.c */
    tg_real unseen_grade; /* variance of a slope that rho_s may be, see roughness.c */
    tg_real weight; /* N, on level ground, with what hangs on the hitch */
    tg_real reckoned; /* least variance of a ground speed that is not measured, see reckoning.c; else 0 */
    tg_real unsaid; /* to a smoother: variance of adhesion and rho_s before this row's brake sample, by what the brake did unsaid; -1: it has none */
    tg_real unseen_load; /* relative variance of a wheel's load */
    tg_real slow_speed; /* variance of the ground speed's slow error, see slow_speed.c, */
    tg_real disputed;   /* of what its sensor and the forces disagree on, and of its samples' age, */
    tg_real late;       /* and of its delay; */
    tg_real astray;     /* of a receiver that contradicts forces and wheels (reckoning.c) */
    tg_real anew; /* the filter was restarted: nothing links this row to the one before */
} tgi_scene;

typedef struct { /* what drives the model between two rows, in the vehicle's own directions */
    tg_real load[8];      /* wheel, N */
    tg_real axle_load[8]; /* N */
    tg_real torque[8], drawbar;
    tg_real calm_drawbar; /* filtered, for the loads, which carry no uncertainty */
    tg_real mass, inverse_mass; /* kg, as measured, else the machine's */
    tg_real hitch_load;   /* N */
    tg_real slope, cosine, sine;
    tg_real drift_by_slope; /* variance that the slope's error gave the ground speed over the step that ends now, (m/s)^2 */
} tg_drive;

typedef struct { /* the estimate with its spreads, along the travel; the filter's row order (mu, rho_s, v, omega), see filter.h */
    tg_real x[TG_ROWS];
    tg_real P[TG_MAX_STATES * TG_ROWS]; /* the lower triangle, rows of tgi_stride(n) */
    int32_t columns;                    /* of considered constants, in the consider object */
    int32_t channels;
    tg_real nis, supervisor;
} tg_belief;

typedef struct { /* a wheel's own time, see wheels.c */
    double until;  /* the time up to which the model has moved its speed, */
    double torque; /* and from which it has done so by the last torque */
    tg_real step;  /* s, of this row: what `until` moved by */
    tg_real hub;   /* m/s, its speed at `until` */
} tgi_own_time;

#define TG_SPEED_STATES (TG_MAX_WHEELS + 2)
#define TG_SPEED_MODES 9

typedef struct { /* see speeds.c; all reals, since a smoother's record is this */
    tg_real x[TG_SPEED_STATES], P[TG_SPEED_STATES][TG_SPEED_STATES]; /* of all modes together: ground speed, its rate, slip speeds */
    tg_real probability[TG_SPEED_MODES];
    tg_real seen[TG_MAX_WHEELS + 1];  /* 1: measured since the motion began; ground speed, wheels */
    tg_real begun;                    /* 1: any of them was, so that the state is one */
    tg_real dt, manoeuvre, slipping;  /* how this row was reached: s, mean densities */
    tg_real anew;                     /* 1: nothing links this row to the one before */
    tg_real yaw, unseen_turn, standing;
    tg_real open;                     /* 1: the rims read nothing that slip could be computed from */
    tg_real slow;                     /* variance of the ground speed's error that does not average out (slow_speed.c) */
    tg_real off;                      /* 1, -1: the last ground speed lay above, below what was expected, and counted less; 0: neither */
} tgi_speeds;

typedef struct {
    tg_real x[TG_SPEED_STATES], P[TG_SPEED_STATES][TG_SPEED_STATES];
} tgi_speed_mode;

typedef struct { /* what follows from the settings alone */
    tg_real limit[TG_SLOTS];        /* beyond it a value is a defect; negative: this machine has no such channel */
    tg_real inverse_gain[TG_SLOTS];
    tg_real variance[TG_SLOTS];     /* noise squared */
    tg_real agility[TG_GROUND_SPEED + 1]; /* rad/s^2, m/s^2: a change of each speed that a vehicle can do */
    tg_real soon[TG_GROUND_SPEED + 1]; /* of each speed, least share of a sample in its low-pass */
    tg_real trust;                  /* in a ground speed against wheels, by its noise */
    tg_real mean_radius;            /* m */
    tg_real outermost;              /* m from the middle to the side: the wheel that is farthest, since another may be a caster there */
    tg_real spin_inertia;           /* sum J/r */
    tg_real unknown_torque[8];      /* variance of a torque never seen */
    tg_real unknown_pull;
    tg_real least_load[8];          /* N; the model divides by the load */
    tg_real least_shock;            /* (m/s^2)^2, variance of the accelerometer at rest */
    tg_real scale_score[TG_MODES];  /* of the bank: log scale, 0 the smallest, 1 the largest */
    tg_real force_walk;             /* m^2/s^3 */
    tg_real mounting_walk;          /* rad^2/s */
    tg_real pace;                   /* s, the unit of time of the watch, see digging.c */
    int32_t watched[8], side[8];    /* wheel: powered, or no wheel is; by its place on its axle -1 left, 1 right, 0 middle */
    tg_real lean[8];                /* wheel: square of the share of its load that a lateral specific force of 1 m/s^2 moves */
    int32_t twin[8];                /* wheel: another driven one of its axle; itself where there is none */
    int32_t holds;                  /* some channel is held */
    int32_t warps, slopes;          /* driven wheels beyond their trends, see warp.c; trends besides the mean, or 0 where hidden.c does not look */
    tg_real pulls[8], share;        /* wheel: 1 where driven; 1 over their number */
    tg_real inverse_radius[8];      /* wheel, of the rolling radius */
    tg_real at_rest[8];             /* wheel: its share of the driven wheels' load at rest */
    tg_real watched_share[8], work; /* wheel: its share of the load of those watched; their share of the driven wheels' */
    tg_real beyond[8][8];           /* wheel by wheel: what a value of the one adds to what no trend holds on the other, see warp.c */
    tg_real middle[8];              /* wheel: trend of the middle against the ends */
    tg_real trend[2][8];            /* wheel: trends along and across, times its share of the load */
} tgi_constants;

struct tg_estimator {
    tg_settings settings;
    tgi_constants constants;
    tg_deviations deviations;
    int32_t started;           /* a sample was seen */
    int32_t seen_motion;       /* a wheel or ground speed was seen: the outputs are numbers */
    int32_t standing;          /* at standstill */
    int32_t direction;         /* of travel: 1 forward, -1 in reverse */
    int32_t by_torque;         /* at rest: adhesion follows from the torques */
    double time, measured_time, distance;
    tg_real last_raw[TG_SLOTS];
    double last_raw_time[TG_SLOTS];
    tg_hold torque[8], drawbar, pitch, axle_load[8], mass, hitch_load;
    tg_hold wheel[8], ground;  /* speeds */
    tg_hold forward, turn;     /* acceleration, yaw rate */
    tgi_own_time own_time[8];      /* see wheels.c */
    int32_t rolls;             /* bits: a free wheel whose speed was never measured, which goes as its hub does */
    int32_t shared[8];         /* wheel: samples in a row in which its torque was another's of its axle, see doubt.c, */
    int32_t locked[8];         /* and its speed */
    int32_t unseen;            /* since a gap: bit 0 no wheel speed, bit 1 no ground speed was measured */
    int32_t braked;            /* a brake turns the wheels, by an unknown torque */
    int32_t pressed;           /* its last sample, */
    tg_real unbraked;          /* and rho_s when it came, */
    double unbraked_time;      /* and when */
    double braked_time;        /* of the last row with a pressed brake; before the first -INFINITY */
    tg_real yaw_rate;
    double yaw_time;           /* of its last sample; before the first -INFINITY, as stamps may be negative */
    tg_real unseen_turn;       /* rad/s: by the rims, where no sensor shows the yaw rate or a joint bends; else 0 */
    double leap_time;          /* since when the ground speed contradicts standstill; infinite: it does not */
    tgi_settling settling[TG_GROUND_SPEED + 1]; /* by place in a sample */
    tg_lowpass acceleration, lateral, roll, balance;
    tgi_slip_memory slip_memory;
    tgi_slope slope;
    tgi_roughness roughness;
    tgi_warped warped;
    tgi_hidden hidden;
    tgi_slow_speed slow_speed;
    tgi_loudness loudness;
    double ground_time;        /* of the last measured ground speed */
    tg_real shock;             /* variance of the accelerometer about the model, (m/s^2)^2 */
    tg_input held;             /* inputs of the last row, along the travel */
    tg_belief belief;
    tg_algebra algebra;
    tgi_watch watch;
    tgi_scene scene;           /* of the last row */
    tg_curve curve, wheel_curve[8];
    tg_real curve_std, wheel_curve_std[8];
    tg_real curve_wait, curve_distance; /* s and m since the curves were last brought up to date */
    tgi_speeds speeds;         /* of the method TG_SPEEDS, */
    tgi_speed_mode speed_mode[TG_SPEED_MODES];
    tg_consider consider;
    tg_track *track;           /* while a smoother's records are written, else null */
    tg_filter filter;          /* last, since its size depends on the policy: see tg_estimator_size */
};

TG_INLINE tg_real tgi_square(tg_real x) { return x * x; }
TG_INLINE tg_real tgi_max(tg_real x, tg_real y) { return x > y ? x : y; }
/* Variance of what an input does from a sample to the next, beyond its noise; and that a second, as of a random walk. */
TG_INLINE tg_real tgi_motion(const tg_hold *h, tg_real noise) { return tgi_max(h->level - 2 * noise * noise, 0); }
TG_INLINE tg_real tgi_walk(const tg_hold *h, tg_real noise) { return h->interval > 0 ? tgi_motion(h, noise) / h->interval : 0; }

/* estimator.c */
void tgi_end_row(tg_estimator *e, const tg_row *row, tg_estimate *out);
int32_t tgi_event_of(const tg_estimator *e, const tg_row *row, int32_t gap, int32_t lost);

/* doubt.c */
#define TG_SAME 8 /* samples alike in a row: two wheels' own torques, or speeds, are not */
void tgi_watch_shares(tg_estimator *e, const tg_sample *sample);
void tgi_doubt_adhesions(tg_estimator *e, const tg_row *row, const tg_drive *drive);

/* quality.c */
tg_status tgi_clean(tg_estimator *e, const tg_sample *sample, tg_row *row);
void tgi_doubt_speeds(tg_estimator *e, tg_row *row);
tg_real tgi_lowpass(tg_lowpass *f, tg_real x, double time, tg_real tau);
TG_INLINE int32_t tgi_rolls(const tg_estimator *e, int32_t i) { return e->rolls >> i & 1; }
int32_t tgi_is_recent(const tg_estimator *e, int32_t slot, double time);
void tgi_track_turn(tg_estimator *e, const tg_row *row);
int32_t tgi_track_motion(tg_estimator *e, const tg_row *row);

/* loads.c */
void tgi_weigh(tg_estimator *e, tg_row *row, tg_drive *drive);
tg_real tgi_mass_spread(const tg_estimator *e);
tg_real tgi_hitch_spread(const tg_estimator *e);
int32_t tgi_roll_known(const tg_estimator *e, double time);
void tgi_loads(tg_estimator *e, const tg_row *row, tg_drive *drive);

/* inputs.c */
int32_t tgi_ground_is_silent(const tg_estimator *e, double time);
void tgi_find_silent(tg_estimator *e, double time);
void tgi_hold_update(const tg_estimator *e, tg_hold *h, const tg_row *row, int32_t slot, tg_real rate);
void tgi_judge_leaps(tg_hold *h, const tg_real *rate, const tg_estimator *torques, int32_t wheels, int32_t among, double time);
void tgi_update_inputs(tg_estimator *e, tg_row *row, tg_real dt, tg_drive *drive);
int32_t tgi_on_the_spot(const tg_estimator *e);
void tgi_input_noise(const tg_estimator *e, const tg_drive *drive, tg_real dt, tg_row *row, tg_real *q);
void tgi_along(const tg_estimator *e, const tg_drive *drive, tg_input *u);

/* deviations.c */
int32_t tgi_deviations(tg_estimator *e, const tg_input *u, const tg_real *mu);

/* settings.c */
void tgi_believe(tg_estimator *e);
tg_status tgi_filter_anew(tg_filter *f, const tg_settings *s);

/* slope.c */
void tgi_slope_correct(tgi_slope *s, tg_real speed, tg_real noise);
void tgi_slope_update(tg_estimator *e, const tg_row *row, tg_real pitch, tg_real dt, tg_drive *drive);

/* wheels.c */
void tgi_time_wheels(tg_estimator *e, tg_real dt, int32_t goes, tg_row *row);

/* reckoning.c */
void tgi_reset_slips(tg_estimator *e);
void tgi_remember_slip(tg_estimator *e, const tg_drive *drive, tg_real dt);
void tgi_watch_signs(tg_estimator *e, const tg_real *o);
void tgi_watch_draw(tg_estimator *e, tg_real innovation, tg_real variance, tg_real gain);
void tgi_reckon_speeds(tg_estimator *e, tg_real dt, tg_row *row);
void tgi_remember_speeds(tg_estimator *e, const tg_row *row, tg_real dt);
void tgi_reckon(tg_estimator *e, const tg_drive *drive, tg_real dt, int32_t goes, tg_row *row, tg_real *q);

#define TG_SAMPLE_AGE ((tg_real)0.288675)    /* sqrt(1/12) intervals: a sample may be of any instant of its own */
#define TG_LOAD_LENGTH ((tg_real)1.25)       /* wheel radii over which an unseen load is assumed to be correlated */

#define TG_NOISE_SHARE ((tg_real)0.5)        /* of a filtered random walk's variance: noise that the estimate follows; the rest is its lag */
/* roughness.c; variance that unseen load adds to an adhesion */
TG_INLINE tg_real tgi_rough_adhesion(const tgi_scene *scene, tg_real mu) { return scene->unseen_load * tgi_square(mu); }
tg_real tgi_relative(const tg_estimator *e, tg_real square);
tg_real tgi_scatter(const tg_estimator *e);
tg_real tgi_unseen_load(const tg_estimator *e);
tg_real tgi_unseen_bumps(const tg_estimator *e);
tg_real tgi_unseen_grade(const tg_estimator *e);
void tgi_watch_roughness(tg_estimator *e, int32_t flowing, tg_real distance);

/* hidden.c */
void tgi_watch_hidden(tg_estimator *e, const tgi_slips *slips, int32_t flowing, tg_real travelled);
tg_real tgi_by_load(const tg_estimator *e, tg_real scatter);

/* warp.c */
tgi_slips tgi_driven_slips(const tg_estimator *e);
void tgi_place_trends(const tg_settings *s, tgi_constants *c);
int32_t tgi_pivot(const tg_settings *s, tg_real *value);
void tgi_warp(const tgi_constants *restrict c, const tg_real *restrict value, tg_real *restrict warp);
void tgi_watch_warp(tg_estimator *e, int32_t flowing, tg_real fresh);
void tgi_watch_slips(tg_estimator *e, const tgi_slips *slips, int32_t flowing, tg_real travelled);
tg_real tgi_lasting_warp(const tg_estimator *e, tg_real *warp);

/* loudness.c */
tg_real tgi_loudness_of(tg_estimator *e, const tg_row *row, tg_real rim);

/* slow_speed.c */
void tgi_rest_reading(tg_estimator *e, const tg_row *row);
void tgi_rest_over(tg_estimator *e);
void tgi_watch_innovation(tg_estimator *e, const tg_row *row, tg_real innovation, tg_real variance);
tg_real tgi_alike_share(const tg_estimator *e);
tg_real tgi_alike_variance(const tg_estimator *e);
tg_real tgi_disputed_variance(const tg_estimator *e, const tg_drive *drive);
tg_real tgi_late_variance(const tg_estimator *e, const tg_drive *drive);
tg_real tgi_slow_variance(const tg_estimator *e);

/* restarts.c */
void tgi_follow(tg_estimator *e, const tg_deviations *deviations);
void tgi_forget(tg_estimator *e);
void tgi_restart_from(tg_estimator *e, const tg_row *row, tg_real walk);
void tgi_unknown_adhesion(tg_estimator *e);
void tgi_turn(tg_estimator *e);
void tgi_rest(tg_estimator *e, const tg_drive *drive, double time);
void tgi_drift(tg_estimator *e, tg_real dt);

/* algebraic.c */
void tgi_algebraic(tg_estimator *e, const tg_row *row, const tg_drive *drive, const tg_input *now, int32_t anew);

/* curves.c */
void tgi_reset_curves(tg_estimator *e);
void tgi_curves(tg_estimator *e, int32_t learn, tg_real dt, tg_real distance, const tg_real *load, tg_real *o);

/* digging.c */
#define TG_SHORT ((tg_real)0.1) /* of the unit of time: rows within it are averaged, and the signals low-passed */
tg_real tgi_pace(const tg_settings *s);
void tgi_digging_rest(tgi_digging *d);
int32_t tgi_digging_update(tg_estimator *e, double time, const tgi_view *row);
void tgi_digging_report(const tgi_digging *d, tg_real *o);

/* immobilization.c */
void tgi_watch_over(tg_estimator *e, const tg_row *row, const tg_drive *drive, int32_t moving, int32_t anew, tg_real dt, tg_real *o);
int32_t tgi_watched(const tg_estimator *e); /* tg_event */

/* speeds.c */
void tgi_speeds_update(tg_estimator *e, tg_row *row, tg_estimate *out);
size_t tgi_speeds_length(void);
void tgi_speeds_smooth(const tg_settings *set, const tg_real *record, const tg_real *next, tg_real *carry, tg_real *o);

/* traction.c */
void tgi_traction(const tg_settings *s, const tg_real *warp, const tg_belief *b, const tg_real (*S)[TG_MAX_CONSIDERED], const tgi_scene *scene, tg_real *o);
#endif
