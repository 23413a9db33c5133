import { svelte } from "@sveltejs/vite-plugin-svelte";
import { defineConfig } from "vite";

export default defineConfig({
  plugins: [svelte()],
  base: "/",
  build: {
    outDir: "../src/subtense/web/static",
    emptyOutDir: true,
    target: "es2022",
    // an inlined asset would be a data: address, which the content security policy does not allow for styles and scripts
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    license: { fileName: "licences.md" },
    rollupOptions: { input: { index: "index.html", measure: "measure.html", api: "api.html" } },
  },
  server: { proxy: { "/api": "http://127.0.0.1:8517" } },
});
