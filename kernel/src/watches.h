/* What the estimator keeps beside the filter: low-passed signals, and what is known by now of uneven ground, of slips and loads, of the ground
 * speed's errors, and of digging in. */
#ifndef TG_WATCHES_H
#define TG_WATCHES_H
#include "terragrip.h"

typedef struct { /* a low-passed signal */
    tg_real value;
    double time; /* of its last sample */
    int32_t seen;
} tg_lowpass;

typedef struct { /* low-passed signals of the algebraic method */
    tg_lowpass wheel[8], ground, torque[8], drawbar;
    tg_real wheel_rate[8], ground_rate; /* derivatives of the low-passed signals */
    tg_real gain;                       /* of this row's low-pass: dt/(tau + dt) */
} tg_algebra;

typedef struct { /* ground speed and slope error with their covariance */
    tg_real speed, error, speed_variance, covariance, error_variance;
    tg_real acceleration; /* last sample */
    int32_t running;
} tgi_slope;

typedef struct { /* low-passed while the ground speed is measured; the whole vehicle */
    tg_real slip, adhesion, variance; /* of speeds alone, the slip's */
    tg_real usual, usual_adhesion; /* over the drive, */
    tg_real apart, way;            /* mean square of the slips about those, wheel radii that these cover */
    tg_real unseen;                /* wheel radii since a ground speed was measured, or believed */
    tg_real drawn, draws;          /* m/s by which ground speeds drew the estimate from its forecast lately; mean square */
    tg_real unusual, contrary;     /* 1: they do so more than is usual; all slips have another sign than adhesions */
    tg_real against;               /* 1: the last reading contradicted forces and wheels, */
    tg_real astray, agreeing;      /* and 1: readings do; s since when they do not, */
    tg_real calm;                  /* and since neither of the two signs above does */
} tgi_slip_memory;

typedef struct { /* uneven ground, see roughness.c */
    tg_real adhesion[8], resistance; /* low-passed over the distance, */
    tg_real mean_resistance;         /* rho_s over the length of bumps */
    tg_real scatter, square;         /* mean squares: of a wheel's adhesion beyond the others', of the adhesion */
    tg_real own;                     /* mean variance of an adhesion, by the filter */
    tg_real wander, bumps;           /* mean squares of rho_s about both: what soil and bumps do within metres, and bumps alone */
    tg_real own_resistance;          /* mean variance of rho_s, by the filter */
    tg_real grade;                   /* mean square of the slope, over the distance, */
    tg_real usual, swing, way;       /* and rho_s: its mean, its mean square about that, wheel radii that these cover; 0: nothing yet */
    tg_real waited;                  /* wheel radii since a row held a wheel's speed */
} tgi_roughness;

typedef struct { /* slips of the driven wheels in a row; 0 of others */
    tg_real along[8], straight[8]; /* on each hub's own way, and as if all went at the vehicle's speed where each points */
    tg_real variance;              /* of one wheel's, by the errors of the wheels' speeds, in the mean */
    int32_t known;                 /* else they show nothing */
} tgi_slips;

typedef struct { /* wheels beyond all trends, see warp.c */
    tg_real now[8], adhesion[8]; /* wheel: adhesion of the row, and low-passed over the length of unevenness */
    tg_real usual[8], slip[8]; /* wheel: slip beyond all trends as a rule, and beyond that low-passed over `slip_length` */
    tg_real wheel_slip[8];     /* wheel: slip, low-passed over the length of unevenness */
    tg_real square, noise;     /* mean squares of that slip before the low-pass: the whole, and the part by errors of the wheel speeds */
    tg_real level, sure;       /* mean square of the slip of all wheels; mean weight of a row in `usual` */
    tg_real pulling, slipping; /* adhesion and slip of all wheels, over the length of unevenness */
    tg_real left;              /* of a step in slip, where one wheel spins (left_by_spin) */
    tg_real usual_trend[2], trend[2]; /* slip along and across as a rule, and beyond that low-passed as `slip` */
    tg_real shown, along_across[2];   /* mean squares of `slip` and of these */
} tgi_warped;

typedef struct { /* driven wheels over a stretch of the way, beyond their usual: sums over `length` wheel radii, and at its end means, along and across */
    tg_real adhesion[8], slip[8], length;
} tgi_stretch;

typedef struct { /* loads from slips, see hidden.c */
    tg_real adhesion[8], slip[8]; /* wheel: low-passed over the length of unevenness */
    tg_real pulling, slipping;    /* of all wheels, likewise */
    tg_real way;                  /* wheel radii since the motion began */
    tgi_stretch now, last[2];     /* this one, the last, and the one before that */
    tg_real plain, beyond, weight, square, count; /* weighted means over so many pairs of stretches, relative to the adhesions: of their products, of what slips add; the weights; the latter's squares */
    tg_real load;                 /* relative variance of adhesion by load beyond what adhesions show; may be less than 0 */
} tgi_hidden;

typedef struct { /* white noise of the ground speed lately, see loudness.c */
    tg_real speed[3], gap[3], step[2]; /* m/s: along the travel in its last samples, newest first, and less the rims'; s between them */
    tg_real power;           /* mean square of their third differences */
    tg_real count;           /* samples in a row, up to 3 */
} tgi_loudness;

typedef struct { /* errors of the ground speed that last, see slow_speed.c */
    tg_real mean, count;    /* of this stop's readings */
    tg_real squares, stops; /* of all stops, weighted */
    tg_real innovation;     /* of the last ground speed; 0: none */
    tg_real alike, pairs;   /* mean product of two innovations that follow each other, over so many */
    tg_real expected;       /* variance of the last innovation, which is the SD of such a product of unlike ones */
} tgi_slow_speed;

typedef struct { /* of the driven wheels, along the travel; see immobilization.c; all reals */
    tg_real slip, deviation, fastest; /* of the worst wheel of each side, their mean: slip, its SD, rim speed */
    tg_real leading, trailing; /* adhesion of these axles, alike where there is but one */
    tg_real resistance, rim, travel; /* rim: mean of all */
    tg_real adhesion_deviation, resistance_deviation, travel_deviation; /* SDs; of the adhesion of either end */
} tgi_view;

enum { TGI_SLIP, TGI_DEVIATION, TGI_BALANCE, TGI_RESISTANCE, TGI_RIM, TGI_TRAVEL, TGI_BALANCE_DEVIATION, TGI_RESISTANCE_DEVIATION, TGI_SIGNALS };

typedef struct { /* see digging.c */
    tgi_view sum;              /* of the rows since the last interval, */
    tg_real rows;              /* and how many they are */
    tg_real now[TGI_SIGNALS], mean[TGI_SIGNALS]; /* low-passed over a tenth of the unit of time, and over it */
    tg_real usual[2];          /* slip, balance */
    tg_real age;               /* s of looking in all */
    tg_real points[TG_SIGNS];
    tg_real score;             /* their sum, low-passed */
    double time;               /* of the end of the last interval, or where the motion began */
    int32_t moving;            /* there was an interval since the motion began */
    int32_t slips;             /* slip rises far, surely, and far beyond its usual */
} tgi_digging;

typedef struct { /* is the vehicle about to be stuck, stuck, pushed? */
    tgi_digging digging;
    tg_real rim, spinning, pushed; /* m/s low-passed; s that each has held */
    tg_real turned;            /* m that the rims went since the motion began */
    double stuck_time;         /* of the last row that was judged for being stuck */
    int32_t turning, held, sinking, stuck, pushing; /* turning: rim holds a value; held: the rims turn, the vehicle hardly moves */
} tgi_watch;
#endif
