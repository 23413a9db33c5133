import { mount } from "svelte";
import Shell from "../parts/Shell.svelte";
void mount;void Shell;
