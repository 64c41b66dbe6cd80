/* A number out of JSON, to the nearest double: for samples that come as text, many a second. */
#include <float.h>
#include <stdint.h>

#include "live.h"

enum { DIGITS = 18, STEP = 22 }; /* 10^18 < 2^63; 10^22 is the last power of ten that is a double */

const double TG_POWERS[23] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                              1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

typedef struct {
    double high, low; /* the number is their sum */
} sum;

static sum halves(double x)
{
    const double c = 134217729.0 * x; /* 2^27 + 1 */
    const sum h = {c - (c - x), x - (c - (c - x))};
    return h;
}

/* a b = high + low without error (Dekker 1971). */
static sum product(double a, double b)
{
    const sum p = halves(a), q = halves(b);
    const double high = a * b;
    const sum found = {high, ((p.high * q.high - high) + p.high * q.low + p.low * q.high) + p.low * q.low};
    return found;
}

static sum together(double high, double low)
{
    const double total = high + low;
    const sum found = {total, low - (total - high)};
    return found;
}

static sum times(sum x, double power)
{
    const sum p = product(x.high, power);
    return together(p.high, p.low + x.low * power);
}

static sum over(sum x, double power)
{
    const double quotient = x.high / power;
    const sum p = product(quotient, power);
    return together(quotient, ((x.high - p.high) - p.low + x.low) / power);
}

static int is_digit(char c)
{
    return c >= '0' && c <= '9';
}

static const char *exponent_of(const char *text, int *exponent)
{
    const int negative = *text == '-';
    if (negative || *text == '+')
        text++;
    if (!is_digit(*text))
        return NULL;
    int size = 0;
    for (; is_digit(*text); text++) {
        if (size > 999)
            return NULL;
        size = 10 * size + (*text - '0');
    }
    *exponent += negative ? -size : size;
    return text;
}

/* The double nearest to `digits` times ten to `exponent`; 0 where that is not certain. */
static int nearest(uint64_t digits, int exponent, double *value)
{
    if (digits == 0) {
        *value = 0.0;
        return 1;
    }
    if (FLT_EVAL_METHOD != 0 || exponent > STEP || exponent < -2 * STEP)
        return 0;
    const double high = (double)digits;
    sum x = {high, (double)((int64_t)digits - (int64_t)high)};
    if (exponent > 0)
        x = times(x, TG_POWERS[exponent]);
    if (exponent < -STEP) {
        x = over(x, TG_POWERS[STEP]);
        exponent += STEP;
    }
    if (exponent < 0)
        x = over(x, TG_POWERS[-exponent]);
    /* 2^-40 of what is left: its error is 2^-47 of half a unit at most, and only near half a unit does it count. */
    const double slack = 9.094947017729282e-13 * x.low;
    *value = x.high + (x.low + slack);
    return *value == x.high + (x.low - slack);
}

const char *tg_read_number(const char *text, double *value)
{
    const int negative = *text == '-';
    text += negative;
    if (!is_digit(*text) || (*text == '0' && is_digit(text[1])))
        return NULL;
    const char *first = text;
    uint64_t digits = 0;
    int count = 0, exponent = 0;
    for (; is_digit(*text); text++, count += digits > 0)
        digits = 10 * digits + (uint64_t)(*text - '0');
    if (*text == '.') {
        const char *point = text++;
        for (; is_digit(*text); text++) {
            digits = 10 * digits + (uint64_t)(*text - '0');
            count += digits > 0;
        }
        exponent = (int)(point + 1 - text);
        if (exponent == 0)
            return NULL;
    }
    if (*text == 'e' || *text == 'E')
        text = exponent_of(text + 1, &exponent);
    if (text == NULL || count > DIGITS || !nearest(digits, exponent, value))
        return NULL;
    if (negative) {
        if (digits == 0 && text == first + 1) /* the integer -0: 0 to some, -0.0 to others */
            return NULL;
        *value = -*value;
    }
    return text;
}
