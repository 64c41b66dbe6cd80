import { readFileSync, readdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { brotliCompressSync, gzipSync } from "node:zlib";
import { defineConfig, type Plugin } from "vite";

/** Every text file beside itself as .br and .gz, made once here instead of at every request. */
function compressed(): Plugin {
  let folder = "";
  return {
    name: "compressed",
    apply: "build",
    configResolved: (config) => {
      folder = join(config.root, config.build.outDir);
    },
    closeBundle: () => {
      for (const name of readdirSync(folder, { recursive: true }) as string[]) {
        if (!/\.(js|css|html|svg)$/.test(name)) continue;
        const path = join(folder, name);
        const content = readFileSync(path);
        if (content.length < 1000) continue;
        writeFileSync(`${path}.br`, brotliCompressSync(content));
        writeFileSync(`${path}.gz`, gzipSync(content, { level: 9 }));
      }
    },
  };
}

export default defineConfig({
  base: "./",
  plugins: [compressed()],
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
