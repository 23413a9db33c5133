import { mount } from "svelte";
import Measure from "./Measure.svelte";

mount(Measure, { target: document.getElementById("app")! });
