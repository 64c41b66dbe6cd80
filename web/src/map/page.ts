/** The map: the track of a run, or the cells of a map that was made of runs. */

import type { Page } from "../ui/page";
import { page as field } from "./field/page";
import { page as track } from "./track_page";

export const page: Page = (main, context) => (context.query.has("map") ? field : track)(main, context);
