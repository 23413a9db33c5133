import { mount } from "svelte";
import Api from "./Api.svelte";

mount(Api, { target: document.getElementById("app")! });
