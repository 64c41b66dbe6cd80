import { defineConfig } from "vite";

export default defineConfig({
  base: "./",
  build: {
    outDir: "../src/terragrip/studio/static",
    emptyOutDir: true,
    target: "es2022",
    // The policy allows no inline script or data: script; small files stay files.
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
  },
  // maplibre-gl shows a blank map under Vite unless its worker is an ES module of ours.
  worker: { format: "es" },
  server: { proxy: { "/api": { target: "http://127.0.0.1:8750", ws: true } } },
});
