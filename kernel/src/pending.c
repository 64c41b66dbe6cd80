/* Not written yet; goes away with unscented.c, bank.c, adaptation.c, supervisor.c, consider.c and smoother.c. */
#include "filter.h"
tg_status tgi_adapt(tg_filter *f, const tgi_plan *plan, const tgi_result *result){(void)f;(void)plan;(void)result;return TG_OK;}
tg_real tgi_supervise(const tg_filter *f, const tgi_plan *plan, const tg_input *now){(void)f;(void)plan;(void)now;return 0;}
void tgi_supervisor_remember(tg_filter *f, const tgi_plan *plan, const tg_input *now){(void)f;(void)plan;(void)now;}
void tgi_bank_init(tg_filter *f){(void)f;}
void tgi_bank_moments(const tg_filter *f, tg_real *x, tg_real *P){(void)f;(void)x;(void)P;}
void tgi_bank_restart(tg_filter *f, const tg_real *outputs, tg_passage *passage){(void)f;(void)outputs;(void)passage;}
