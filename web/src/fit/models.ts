/** Adhesion-slip curves (terragrip.physics.adhesion), for drawing while a slider moves. A test holds them against the server's values. */

export type Parameters = Record<string, number>;
type Curve = (s: number, q: (name: string) => number) => number;

/** mu for s >= 0; every curve is odd in slip. */
const POSITIVE: Record<string, Curve> = {
  exponential: (s, q) => q("a") * (1 - q("p") * Math.exp(q("alpha_1") * s) - (1 - q("p")) * Math.exp(q("alpha_2") * s)),
  effective: (s, q) => -q("A") * Math.expm1(-q("k") * s) - q("d") * s,
  burckhardt: (s, q) => -q("c1") * Math.expm1(-q("c2") * s) - q("c3") * s,
  pacejka: (s, q) => {
    const x = q("B") * s;
    return q("D") * Math.sin(q("C") * Math.atan(x - q("E") * (x - Math.atan(x))));
  },
  schreiber_kutzbach: (s, q) => -q("b") * Math.expm1(-q("c") * s) - q("d") * s,
  brixius: (s, q) => 0.88 * Math.expm1(-0.1 * q("mobility")) * Math.expm1(-7.5 * s),
  wismer_luth: (s, q) => -0.75 * Math.expm1(-0.3 * q("wheel_numeric") * s),
};

/** mu(s), or kappa(s) with an intercept of -rho. NaN for a model or a parameter that is not known. */
export function value(model: string, parameters: Parameters, slip: number): number {
  const positive = POSITIVE[model];
  if (!positive) return NaN;
  const own = (name: string): number => parameters[name] ?? NaN;
  const native = model === "schreiber_kutzbach" ? own("a") - own("b") : 0;
  return Math.sign(slip) * positive(Math.abs(slip), own) + native + (parameters["intercept"] ?? 0);
}

export const KNOWN = Object.keys(POSITIVE);
